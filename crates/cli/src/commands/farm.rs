//! `glimt farm`: prints a Slurm, GNU parallel or Kubernetes script that renders an image in parts.

use std::path::Path;

use clap::Parser;

use crate::args::{Args, ClusterScheduler, FarmArgs, RenderArgs, Switch};
use crate::console::Console;
use crate::exit::Exit;
use crate::output::Format;
use crate::pipeline::estimate_memory;
use crate::pipeline::protocol::Failure;
use crate::system::text::is_terminal_safe_char;

pub(crate) fn run(args: &FarmArgs, console: &Console) -> Exit {
    if let Err(error) = Format::from_path(&args.output) {
        return console.print_error(Exit::WRONG, &error.to_string());
    }
    let paths = [args.scene.to_str(), args.output.to_str()];
    let words = args.options.iter().chain(&args.hosts).map(String::as_str).chain(paths.into_iter().flatten());
    // A line break in a name could end a here-document. Other control characters are unsafe on terminals.
    let words = words.chain([args.image.as_str(), args.claim.as_str()]);
    if paths.contains(&None) || words.into_iter().any(|word| !has_only_visible_chars(word)) {
        return console.print_error(Exit::WRONG, "names cannot contain control characters");
    }
    if !args.scene.is_file() {
        return console.print_error(Exit::WRONG, &format!("file not found: {}", args.scene.display()));
    }
    let options = match parse_render_options(args) {
        Ok(options) => options,
        Err(message) => return console.print_error(Exit::WRONG, &format!("after `--`: {message}")),
    };
    console.print_trusted_text(&match args.engine {
        ClusterScheduler::Slurm => slurm_script(args),
        ClusterScheduler::Parallel => gnu_parallel_script(args),
        ClusterScheduler::Kubernetes => kubernetes_manifest(args, memory_request(args, &options, console)),
    });
    Exit::DONE
}

/// Whether a word is safe in scripts and on terminals: it has no control characters or invisible characters.
fn has_only_visible_chars(word: &str) -> bool {
    word.chars().all(is_terminal_safe_char)
}

/// Parses the render options.
///
/// # Errors
/// Returns an error if an option is invalid or cannot be shared by all parts.
fn parse_render_options(args: &FarmArgs) -> Result<RenderArgs, String> {
    let (program, scene) = ("glimt".to_owned(), disambiguate_path_argument(&args.scene));
    let words = [program, scene].into_iter().chain(args.options.iter().cloned());
    let render = match Args::try_parse_from(words) {
        Ok(Args { command: None, render }) => render,
        Ok(Args { command: Some(_), .. }) => {
            return Err("expected render options, not a command".to_owned());
        }
        Err(error) => return Err(error_message_without_usage(&error)),
    };
    let photons_by_error =
        render.photons == Some(Switch::On) && render.error.is_some_and(|error| error > 0.0);
    let faults = [
        (!render.outputs.is_empty(), "put -o before `--`; the parts are named automatically"),
        (render.shard.is_some(), "--shard is added by the script"),
        (render.once, "--once is added by the script"),
        (render.resume, "--resume is added by the script"),
        (render.report.is_some(), "--report would be the same file for all parts"),
        (render.time.is_some(), "--shard does not work with --time"),
        (photons_by_error, "--shard does not work with photons and --error"),
    ];
    match faults.iter().find(|(is_there, _)| *is_there) {
        Some((_, message)) => Err((*message).to_owned()),
        None => Ok(render),
    }
}

/// Thread count assumed without `--threads`. A node may have more processors than this machine.
const NODE_THREADS: usize = 64;

/// Returns a container's memory request in MiB: the estimate for one part, plus 25 %. Prints a warning and
/// returns `None` if the scene cannot be read.
fn memory_request(args: &FarmArgs, options: &RenderArgs, console: &Console) -> Option<u64> {
    let mut overrides = options.overrides();
    (overrides.shard, overrides.outputs) = (Some((1, args.shards)), vec![args.output.clone()]);
    overrides.threads = overrides.threads.filter(|count| *count > 0).or(Some(NODE_THREADS));
    let why = match estimate_memory(&args.scene, &overrides) {
        Ok(bytes) => return Some((bytes + bytes / 4).div_ceil(1 << 20)),
        Err(Failure::Work(why)) => why,
        Err(Failure::Scene(diagnostics)) => {
            console.print_diagnostics(&diagnostics);
            "the scene has errors".to_owned()
        }
    };
    console.print_line_to_stderr(&format!("warning: the jobs have no memory request: {why}"));
    None
}

/// Returns a clap error's message without the usage text.
fn error_message_without_usage(error: &clap::Error) -> String {
    if !error.use_stderr() {
        return "expected render options, not --help or --version".to_owned();
    }
    let text = error.to_string();
    let lines: Vec<&str> = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}

/// Quotes a word for a shell.
fn quote_word(text: &str) -> String {
    shlex::try_quote(text).map_or_else(|_| text.to_owned(), |quoted| quoted.into_owned())
}

/// Formats a path so that glimt does not mistake it for an option or a command.
fn disambiguate_path_argument(path: &Path) -> String {
    let text = path.to_string_lossy();
    let is_bare = text.starts_with('-') || !text.contains(['/', '.']);
    if is_bare { format!("./{text}") } else { text.into_owned() }
}

/// Returns the command that renders one part. `index` is a shell expression for the part's number.
fn part_render_command(args: &FarmArgs, index: &str) -> String {
    let (scene, part) =
        (quote_word(&disambiguate_path_argument(&args.scene)), shell_quoted_part_path(args, index));
    let options: String = args.options.iter().map(|option| format!(" {}", quote_word(option))).collect();
    format!("glimt {scene} --once -o {part} --shard {index}/{} --resume{options}", args.shards)
}

/// Returns the path of one part, quoted for the shell.
fn shell_quoted_part_path(args: &FarmArgs, index: &str) -> String {
    format!("{}.{index}.part", quote_word(&disambiguate_path_argument(&args.output)))
}

/// Returns the command that merges the parts. It lists the parts with `seq`.
fn parts_merge_command(args: &FarmArgs, options: &str) -> String {
    let (out, count) = (quote_word(&disambiguate_path_argument(&args.output)), args.shards);
    format!(
        "seq -f {}.%.0f.part {count} | xargs -d '\\n' glimt merge {options}{out}",
        quote_word(&escape_output_for_seq(args))
    )
}

/// The output path, escaped for `seq`'s format string.
fn escape_output_for_seq(args: &FarmArgs) -> String {
    disambiguate_path_argument(&args.output).replace('%', "%%")
}

fn slurm_script(args: &FarmArgs) -> String {
    let (count, render, merge) =
        (args.shards, part_render_command(args, "$SLURM_ARRAY_TASK_ID"), parts_merge_command(args, ""));
    format!(
        "\
#!/bin/sh
# Renders {count} parts and merges them. Run this in the folder that the paths are relative to.
# A job that is preempted or reaches its time limit saves a checkpoint, is requeued and resumes.
set -eu
parts=$(sbatch --parsable --job-name=glimt --array=1-{count} --requeue --signal=B:USR1@60 <<'JOB'
#!/bin/sh
{render} &
trap 'kill -TERM $!; wait $!' TERM
trap 'kill -TERM $!; wait $!; scontrol requeue ${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID' USR1
wait $!
JOB
)
merge=$(sbatch --parsable --job-name=glimt-merge --kill-on-invalid-dep=yes --dependency=afterok:\"${{parts%%;*}}\" <<'JOB'
#!/bin/sh
{merge}
JOB
)
echo \"parts: job $parts; merge: job $merge\"
"
    )
}

fn gnu_parallel_script(args: &FarmArgs) -> String {
    let (count, merge) = (args.shards, parts_merge_command(args, ""));
    // Pass one command per line, because parallel would expand braces in file names inside a command
    // template.
    let index = "\u{0}";
    let render: Vec<String> = part_render_command(args, index).split(index).map(quote_word).collect();
    let (format, render) = ("%s".repeat(2 * render.len() - 1), render.join(" \"$index\" "));
    let hosts: String = args.hosts.iter().map(|host| format!(" --sshlogin {}", quote_word(host))).collect();
    let way = if args.hosts.is_empty() { "" } else { " --workdir \"$PWD\"" };
    format!(
        "\
#!/bin/sh
# Renders {count} parts, one at a time on each machine, and merges them. Killed parts are retried. If the script is run again,
# it continues: finished parts are kept, and glimt refuses to replace parts rendered from another scene or with other options.
set -eu
seq {count} | while read -r index; do printf '{format}\\n' {render}; done |
    parallel --jobs 1 --retries 3 --halt soon,fail=1{way}{hosts}
{merge}
"
    )
}

fn kubernetes_manifest(args: &FarmArgs, mebibytes: Option<u64>) -> String {
    let (count, render, merge) = (
        args.shards,
        part_render_command(args, "$index"),
        parts_merge_command(args, "--watch --progress plain "),
    );
    let (image, claim) = (quote_yaml(&args.image), quote_yaml(&args.claim));
    let render = quote_yaml_container_command(&format!("index=$((JOB_COMPLETION_INDEX + 1)); exec {render}"));
    let resources = mebibytes.map_or(String::new(), |size| {
        format!(
            "        resources:\n          requests:\n            memory: {size}Mi\n          limits:\n            memory: {size}Mi\n"
        )
    });
    let job = |name: &str, indexed: &str, command: &str| {
        format!(
            "\
apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
{indexed}  backoffLimit: 6
  template:
    spec:
      restartPolicy: OnFailure
      containers:
      - name: glimt
        image: {image}
        workingDir: /work
        command: [\"sh\", \"-c\", {command}]
{resources}        volumeMounts:
        - name: work
          mountPath: /work
      volumes:
      - name: work
        persistentVolumeClaim:
          claimName: {claim}
"
        )
    };
    let indexed = format!("  completions: {count}\n  parallelism: {count}\n  completionMode: Indexed\n");
    format!(
        "# Renders {count} parts and merges them: kubectl apply -f -\n{}---\n{}",
        job("glimt", &indexed, &render),
        job("glimt-merge", "", &quote_yaml_container_command(&merge))
    )
}

/// Formats a container command. Escapes `$` because Kubernetes expands `$(NAME)` and `$$`.
fn quote_yaml_container_command(text: &str) -> String {
    quote_yaml(&text.replace('$', "$$"))
}

/// Quotes a string for YAML, as a JSON string.
fn quote_yaml(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Args, Subcommand};

    fn args(line: &str) -> FarmArgs {
        let words = shlex::split(&format!("glimt farm {line}")).expect("words");
        match Args::try_parse_from(words).expect("valid arguments").command {
            Some(Subcommand::Farm(args)) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn control_characters_are_rejected() {
        for word in ["a\nb", "\0", "\u{1b}]52;c;eA==\u{7}", "\u{9b}31m", "\u{202e}gnp.exr", "a\tb", "\r"] {
            assert!(!has_only_visible_chars(word), "{word:?}");
        }
        for word in ["", "my scene.toml", "Würfel.exr", "$(x) `y` 'z'"] {
            assert!(has_only_visible_chars(word), "{word:?}");
        }
    }

    #[test]
    fn names_are_quoted_for_the_shell() {
        let args = args("'my scene.toml' -o \"it's 5% $HOME.exr\" --shards 3 --engine slurm -- --samples 8");
        let call = part_render_command(&args, "1");
        let words = shlex::split(&call).expect("words");
        assert_eq!(&words[..5], ["glimt", "my scene.toml", "--once", "-o", "it's 5% $HOME.exr.1.part"]);
        assert_eq!(&words[words.len() - 2..], ["--samples", "8"]);
        let joined = shlex::split(&parts_merge_command(&args, "")).expect("words");
        assert!(joined.contains(&"it's 5%% $HOME.exr.%.0f.part".to_owned()), "{joined:?}");
    }

    #[test]
    fn parallel_does_not_expand_names() {
        let name = "{= `touch pwned` =}{}{1} it's.toml";
        let args = args(&format!("{} -o 'a {{}}.exr' --shards 2 --engine parallel", quote_word(name)));
        let script = gnu_parallel_script(&args);
        let lines = script.lines().find(|line| line.starts_with("seq 2 | while")).expect("the commands");
        let lines = lines.strip_suffix(" |").expect("a pipe");
        let printed = std::process::Command::new("sh").args(["-c", lines]).output().expect("a shell");
        let printed = String::from_utf8(printed.stdout).expect("text");
        let second = shlex::split(printed.lines().nth(1).expect("two parts")).expect("words");
        assert_eq!(&second[1..], [name, "--once", "-o", "a {}.exr.2.part", "--shard", "2/2", "--resume"]);
    }

    #[test]
    fn only_options_valid_for_all_parts_are_accepted() {
        let said = |options: &str| {
            let args = args(&format!("a.toml -o a.exr --shards 2 --engine slurm -- {options}"));
            parse_render_options(&args).err().unwrap_or_default()
        };
        for (options, words) in [
            ("-o x.png", "-o "),
            ("--shard 1/3", "--shard"),
            ("--once", "--once"),
            ("--resume", "--resume"),
            ("--report r.json", "--report"),
            ("--time 3", "--time"),
            ("--photons on --error 0.1", "--error"),
            ("--sample 3", "'--sample'"),
            ("--samples 0", "'0'"),
            ("--samples 3 --samples 4", "--samples"),
            ("another.toml", "another.toml"),
            ("check b.toml", ""),
            ("--help", "--help"),
        ] {
            let said = said(options);
            assert!(!said.is_empty() && said.contains(words) && !said.contains('\n'), "{options}: {said:?}");
        }
        for options in
            ["", "--samples 9 --integrator path --error 0.1", "--photons on", "--checkpoint 5 --threads 2"]
        {
            assert_eq!(said(options), "", "{options}");
        }
    }

    /// Expands a command as Kubernetes does: `$(NAME)` becomes the value of an existing variable, and `$$`
    /// becomes `$` (k8s.io/kubernetes/third_party/forked/golang/expansion).
    fn expanded(text: &str, variables: &[(&str, &str)]) -> String {
        let (mut out, mut rest) = (String::new(), text);
        while let Some(at) = rest.find('$') {
            out += &rest[..at];
            rest = &rest[at + 1..];
            if let Some(after) = rest.strip_prefix('$') {
                out.push('$');
                rest = after;
            } else if let Some((name, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
                let known = variables.iter().find(|(known, _)| *known == name);
                out += &known.map_or(format!("$({name})"), |(_, value)| (*value).to_owned());
                rest = after;
            } else {
                out.push('$');
            }
        }
        out + rest
    }

    #[test]
    fn kubernetes_and_the_shell_keep_names_unchanged() {
        let (scene, picture) = ("$(HOME) $$ $$(HOME).toml", "o $$ $(JOB_COMPLETION_INDEX).exr");
        let args =
            args(&format!("{} -o {} --shards 8 --engine kubernetes", quote_word(scene), quote_word(picture)));
        let script = kubernetes_manifest(&args, None);
        let commands: Vec<String> = script
            .lines()
            .filter_map(|line| line.trim().strip_prefix("command: "))
            .map(|command| {
                let words: Vec<String> = serde_json::from_str(command).expect("a list of strings");
                expanded(&words[2], &[("HOME", "/root"), ("JOB_COMPLETION_INDEX", "3")])
            })
            .collect();
        assert_eq!(commands.len(), 2);
        let print = commands[0].replace("exec glimt", "printf '%s\\n'");
        assert_ne!(print, commands[0]);
        let printed = std::process::Command::new("sh")
            .env("JOB_COMPLETION_INDEX", "3")
            .args(["-c", &print])
            .output()
            .expect("a shell");
        let printed = String::from_utf8(printed.stdout).expect("text");
        let words: Vec<&str> = printed.lines().collect();
        let part = format!("{picture}.4.part");
        assert_eq!(words, [scene, "--once", "-o", &part, "--shard", "4/8", "--resume"]);
    }

    #[test]
    fn memory_request_assumes_many_threads() {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n").expect("written");
        let stated = |threads: &str| {
            let line = format!("{} -o a.png --shards 8 --engine kubernetes", scene.display());
            let args = args(&format!("{line} -- {threads}"));
            let options = parse_render_options(&args).expect("valid options");
            memory_request(&args, &options, &Console::new(crate::tui::ColorDepthChoice::None))
        };
        assert_eq!(stated("--threads 0"), stated("--threads 64"));
        assert!(stated("--threads 0") > stated("--threads 2"), "{:?}", stated("--threads 0"));
    }

    #[test]
    fn kubernetes_jobs_are_yaml_with_json_strings() {
        let args = args("a.toml -o 'a \"b\".exr' --shards 8 --engine kubernetes");
        let bare = kubernetes_manifest(&args, None);
        let script = kubernetes_manifest(&args, Some(640));
        assert_eq!((script.matches("memory: 640Mi").count(), bare.contains("memory")), (4, false));
        let stated = "        resources:\n          requests:\n            memory: 640Mi\n          limits:\n            memory: 640Mi\n";
        assert_eq!(script.replace(stated, ""), bare);
        assert!(script.contains("completions: 8") && script.contains("completionMode: Indexed"));
        let commands = script.lines().filter_map(|line| line.trim().strip_prefix("command: "));
        for command in commands {
            let words: Vec<String> = serde_json::from_str(command).expect("a list of strings");
            assert_eq!(&words[..2], ["sh", "-c"]);
        }
    }
}
