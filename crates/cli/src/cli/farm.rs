//! `glimt farm`: the script by which a program that people have spreads the parts of a picture over machines.

use std::path::Path;

use super::args::{Engine, FarmArgs};
use super::console::Console;
use super::exit::Exit;
use crate::output::Format;

pub(super) fn run(args: &FarmArgs, console: &Console) -> Exit {
    if let Err(error) = Format::of(&args.output) {
        return console.fail(Exit::WRONG, &error.to_string());
    }
    let paths = [args.scene.to_str(), args.output.to_str()];
    let words = args.options.iter().chain(&args.hosts).map(String::as_str).chain(paths.into_iter().flatten());
    // A line of a name could end a document in the script.
    if paths.contains(&None) || words.into_iter().any(|word| word.contains(['\n', '\0'])) {
        return console
            .fail(Exit::WRONG, "a script cannot hold this name: use names of letters, digits, - and _");
    }
    if !args.scene.is_file() {
        return console.fail(Exit::WRONG, &format!("{}: no such file", args.scene.display()));
    }
    console.text(&match args.engine {
        Engine::Slurm => slurm(args),
        Engine::Parallel => parallel(args),
        Engine::Kubernetes => kubernetes(args),
    });
    Exit::DONE
}

/// One word for a shell, for glimt no option and no command.
fn word(text: &str) -> String {
    shlex::try_quote(text).map_or_else(|_| text.to_owned(), |quoted| quoted.into_owned())
}

fn file(path: &Path) -> String {
    let text = path.to_string_lossy();
    let is_bare = text.starts_with('-') || !text.contains(['/', '.']);
    if is_bare { format!("./{text}") } else { text.into_owned() }
}

/// The call that renders one part; `index` stands for its number in a shell, outside of quotes.
fn render(args: &FarmArgs, index: &str) -> String {
    let (scene, part) = (word(&file(&args.scene)), part(args, index));
    let options: String = args.options.iter().map(|option| format!(" {}", word(option))).collect();
    format!("glimt {scene} --once -o {part} --shard {index}/{} --resume{options}", args.shards)
}

/// The file of one part.
fn part(args: &FarmArgs, index: &str) -> String {
    format!("{}.{index}.part", word(&file(&args.output)))
}

/// The call that joins the parts, whose names are the words that this shell command prints.
fn merge(args: &FarmArgs, options: &str) -> String {
    let (out, count) = (word(&file(&args.output)), args.shards);
    format!("seq -f {}.%.0f.part {count} | xargs -d '\\n' glimt merge {options}{out}", word(&escaped(args)))
}

/// The output in a format of `seq`.
fn escaped(args: &FarmArgs) -> String {
    file(&args.output).replace('%', "%%")
}

fn slurm(args: &FarmArgs) -> String {
    let (count, render, merge) = (args.shards, render(args, "$SLURM_ARRAY_TASK_ID"), merge(args, ""));
    format!(
        "\
#!/bin/sh
# Renders in {count} parts and joins them. Give this to a shell in the folder where the paths hold.
# A job that is preempted or near its time limit saves a checkpoint, is queued again, and goes on from there.
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

fn parallel(args: &FarmArgs) -> String {
    let (count, merge) = (args.shards, merge(args, ""));
    // A part appears under its name when it is whole. Each line that parallel reads is a command: in a template it would take
    // parts of names for its own.
    let index = "\u{0}";
    let render = format!("test -e {} || {}", part(args, index), render(args, index));
    let render: Vec<String> = render.split(index).map(word).collect();
    let (format, render) = ("%s".repeat(2 * render.len() - 1), render.join(" \"$index\" "));
    let hosts: String = args.hosts.iter().map(|host| format!(" --sshlogin {}", word(host))).collect();
    let way = if args.hosts.is_empty() { "" } else { " --workdir \"$PWD\"" };
    format!(
        "\
#!/bin/sh
# Renders in {count} parts, one at a time on each machine, and joins them. Called again, it goes on where it was;
# remove the parts of another scene first.
set -eu
seq {count} | while read -r index; do printf '{format}\\n' {render}; done |
    parallel --jobs 1 --halt soon,fail=1{way}{hosts}
{merge}
"
    )
}

fn kubernetes(args: &FarmArgs) -> String {
    let (count, render, merge) =
        (args.shards, render(args, "$index"), merge(args, "--watch --progress plain "));
    let (image, claim) = (yaml(&args.image), yaml(&args.claim));
    let render = yaml(&format!("index=$((JOB_COMPLETION_INDEX + 1)); exec {render}"));
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
        volumeMounts:
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
        "# Renders in {count} parts and joins them: kubectl apply -f -\n{}---\n{}",
        job("glimt", &indexed, &render),
        job("glimt-merge", "", &yaml(&merge))
    )
}

/// A text as YAML holds it: a string of JSON is one.
fn yaml(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::args::{Args, Subcommand};
    use super::*;

    fn args(line: &str) -> FarmArgs {
        let words = shlex::split(&format!("glimt farm {line}")).expect("words");
        match Args::try_parse_from(words).expect("right").command {
            Some(Subcommand::Farm(args)) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn names_are_words_of_a_shell() {
        let args = args("'my scene.toml' -o \"it's 5% $HOME.exr\" --shards 3 --engine slurm -- --samples 8");
        let call = render(&args, "1");
        let words = shlex::split(&call).expect("words");
        assert_eq!(&words[..5], ["glimt", "my scene.toml", "--once", "-o", "it's 5% $HOME.exr.1.part"]);
        assert_eq!(&words[words.len() - 2..], ["--samples", "8"]);
        let joined = shlex::split(&merge(&args, "")).expect("words");
        assert!(joined.contains(&"it's 5%% $HOME.exr.%.0f.part".to_owned()), "{joined:?}");
    }

    #[test]
    fn parallel_reads_whole_commands() {
        let name = "{= `touch pwned` =}{}{1} it's.toml";
        let args = args(&format!("{} -o 'a {{}}.exr' --shards 2 --engine parallel", word(name)));
        let script = parallel(&args);
        let lines = script.lines().find(|line| line.starts_with("seq 2 | while")).expect("the commands");
        let lines = lines.strip_suffix(" |").expect("a pipe");
        let printed = std::process::Command::new("sh").args(["-c", lines]).output().expect("a shell");
        let printed = String::from_utf8(printed.stdout).expect("text");
        let second = shlex::split(printed.lines().nth(1).expect("two parts")).expect("words");
        assert_eq!(&second[..4], ["test", "-e", "a {}.exr.2.part", "||"]);
        assert_eq!(&second[5..], [name, "--once", "-o", "a {}.exr.2.part", "--shard", "2/2", "--resume"]);
    }

    #[test]
    fn a_job_of_kubernetes_is_yaml_with_strings_of_json() {
        let script = kubernetes(&args("a.toml -o 'a \"b\".exr' --shards 8 --engine kubernetes"));
        assert!(script.contains("completions: 8") && script.contains("completionMode: Indexed"));
        let commands = script.lines().filter_map(|line| line.trim().strip_prefix("command: "));
        for command in commands {
            let words: Vec<String> = serde_json::from_str(command).expect("a list of strings");
            assert_eq!(&words[..2], ["sh", "-c"]);
        }
    }
}
