#!/usr/bin/env python3
"""Mutation testing with hand-written faults: each fault of the table below must make its test fail.

    python3 .ci/mutation.py [PROFILE [WORD]]      (default: dev)

All faults are inserted at once into a copy of the sources under target/injected, each behind a switch, so that the copy is built only
once. All tests must pass without a fault; then each test is run with only its own fault switched on. The sources themselves are not
changed. WORD selects the faults whose file or test contains it.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COPY = ROOT / "target" / "injected"
SWITCH = """
/// Whether a fault is switched on, by its number in the table.
#[inline]
pub fn injected(fault: u32) -> bool {
    static ASKED: std::sync::LazyLock<Option<u32>> =
        std::sync::LazyLock::new(|| std::env::var("GLIMT_FAULT").ok().and_then(|asked| asked.parse().ok()));
    *ASKED == Some(fault)
}
"""
GLOBAL = "closed_forms::global::"
MANY = "closed_forms::many_lights::"
PHOTONS = "closed_forms::photons::"
PROJECTIONS = "closed_forms::projections::"
CAUSTICS = "closed_forms::caustics::"
MICROFACETS = "closed_forms::microfacets::"
METAL = "materials::bxdfs::conductor::tests::"
NOISE = "materials::texture::noise::tests::"
STRIPES = "materials::texture::stripes::tests::"
PLASTIC = "materials::bxdfs::plastic::tests::"
FACTS = "formats::mitsuba::tests::facts::"
MITSUBA = "formats::mitsuba::"
MITSUBA_FEATURES = "formats::mitsuba::tests::features::"
PRINCIPLED = "materials::bxdfs::principled::tests::"
COATED = "materials::bxdfs::coated::tests::"
FROSTED = "closed_forms::frosted::"
ROUGH_GLASS = "materials::bxdfs::rough_dielectric::tests::"
NULL_INTERACTIONS = "closed_forms::null_interactions::"
TWO_SIDED = "closed_forms::two_sided::"
DIRECT = "direct::"
PICKS = "direct::light_tree::"
SKY = "lights::infinite::sky::tests::"
SUBDIVISION = "assets::mesh::subdivide::tests::"
PBRT = "formats::pbrt::"
PBRT_FACTS = "formats::pbrt::tests::facts::"

# Fault, file, the code around the expression in ⟦⟧, its replacement, and the test that must fail.
FAULTS = [
    ("rows at the poles read as centered rows", "lights/infinite/environment_map.rs", "Self::Poles if rows > 1 => (⟦rows as f32 - 1.0⟧, 1.0),", "rows as f32",
     "lights::infinite::environment::tests::rows_at_the_poles_are_interpolated_exactly"),
    ("linear bases without interreflection", "materials/bxdfs/plastic/mod.rs", "if is_linear { diffuse / ⟦(1.0 - returned)⟧ } else", "1.0",
     PLASTIC + "linear_bases_scale_the_white_base"),
    ("fields of view along y", "formats/mitsuba/settings.rs", "\"x\" => ⟦half / aspect⟧,", "half",
     FACTS + "field_of_view_is_along_x"),
    ("depth limits that are not converted", "formats/mitsuba/settings.rs", "(⟦depth - 1⟧).clamp(0, 10_000)", "depth",
     FACTS + "depth_limits_count_vertices"),
    ("differentiable path tracers without a limit", "formats/mitsuba/settings.rs", "starts_with(\"prb\") { ⟦6⟧ }", "-1",
     MITSUBA_FEATURES + "differentiable_integrators_have_limits"),
    ("images that are not flipped", "formats/mitsuba/textures.rs", "return Self { rows: [first, ⟦flipped⟧], offset", "second",
     FACTS + "images_start_at_the_top_row"),
    ("checkerboards that are not swapped", "formats/mitsuba/textures.rs", "TextureUse::Number => ⟦colors.reverse()⟧,", "{}",
     FACTS + "checkerboards_swap_colors_as_numbers"),
    ("flat emission spectra that are white", "formats/mitsuba/colors.rs", "ColorRole::Emission => ⟦equal_energy_emission_color() * *value⟧,", "DVec3::splat(*value)",
     FACTS + "flat_emission_spectra_are_purple"),
    ("roughness that is α", "formats/mitsuba/bsdfs/surfaces.rs", "shorten_number(⟦libm::sqrt(alpha.clamp(1e-4, 1.0))⟧).into(),\n            NumberSource::Texture(texture) => match self.roughness_texture", "alpha",
     FACTS + "roughness_is_the_root_of_alpha"),
    ("reflectances of plastic that are copied", "formats/mitsuba/plastic.rs", "if remapped.is_finite() { ⟦remapped.clamp(0.0, 1.0)⟧ } else", "kd",
     FACTS + "plastic_is_linear_by_default"),
    ("environment maps that are not turned", "formats/mitsuba/emitters.rs", "linear_part(&matrix) * ⟦half_turn⟧);", "DMat3::IDENTITY",
     FACTS + "environment_maps_start_at_minus_z"),
    ("parts of blends that are converted once per path", "formats/mitsuba/bsdfs/nested.rs", "if let Some(known) = ⟦self.blend_parts.get(&key)⟧ {", "None::<&Option<String>>",
     "formats::mitsuba::tests::limits::blend_chains_share_their_materials"),
    ("parts of blends that ignore their mask", "formats/mitsuba/bsdfs/nested.rs", "coat, depth: _ } = ⟦context⟧;", "BsdfContext { mask: None, ..context }",
     "formats::mitsuba::tests::limits::blend_parts_depend_on_their_context"),
    ("searches that watch one place", "formats/mitsuba/assets.rs", "if ⟦self.watched_files.insert(candidate.clone())⟧ {", "self.watched_files.is_empty() && self.watched_files.insert(candidate.clone())",
     "formats::mitsuba::tests::files::all_places_of_missing_files_are_watched"),
    ("copied files whose names collide", "formats/mitsuba/assets.rs", "while ⟦!self.used_asset_names.insert(name.clone())⟧ {", "!self.used_asset_names.insert(name.clone()) && next < 3",
     "formats::mitsuba::tests::files::copied_files_have_different_names"),
    ("mirrored rectangles whose front is reversed", "formats/mitsuba/shapes.rs", "let is_reversed = ⟦is_mirroring(&matrix) != is_flipped⟧;\n        let uv = UvFlips { flips_u: is_reversed", "is_flipped",
     FACTS + "mirrored_rectangles_keep_their_front"),
    ("attributes of the wrong faces", "formats/mitsuba/mesh_attributes.rs", "DVec2::new((⟦column⟧ + 0.5) / width as f64,", "0.0",
     MITSUBA_FEATURES + "attributes_of_faces_are_images"),
    ("disks whose angle is reversed", "formats/mitsuba/disks.rs", "let angle = TAU * ⟦uv.y⟧;", "(1.0 - uv.y)",
     MITSUBA + "disks::tests::coordinates_are_radius_and_angle"),
    ("radii of curves that are transformed", "formats/mitsuba/curves.rs", "center.extend(⟦radius⟧)", "2.0 * radius",
     MITSUBA_FEATURES + "curves_are_tubes"),
    ("splines through their control points", "formats/mitsuba/curves.rs", "⟦3.0 * t3 - 6.0 * t2 + 4.0⟧,", "3.0 * t3 - 6.0 * t2 + 6.0",
     MITSUBA + "curves::tests::splines_interpolate_lines_and_radii"),
    ("joints of linear curves with two spheres", "formats/mitsuba/curves.rs", "if !is_spline && ⟦number > 0⟧ {", "false",
     MITSUBA + "curves::tests::joints_belong_to_the_previous_segment"),
    ("media whose scale is ignored", "formats/mitsuba/media.rs", "(absorption * ⟦scale⟧)", "1.0",
     MITSUBA_FEATURES + "absorbing_media_in_glass_are_tints"),
    ("checkered roughness that is not swapped", "formats/mitsuba/bsdfs/checkered.rs", "⟦colors.reverse()⟧;", "()",
     MITSUBA_FEATURES + "checkered_roughness_is_a_blend"),
    ("projectors without the cosine", "formats/mitsuba/projectors.rs", "(ratio * ⟦libm::sqrt(ratio)⟧)", "1.0",
     MITSUBA + "projectors::tests::images_are_equalized_by_the_cosine"),
    ("projectors without π", "formats/mitsuba/projectors.rs", "factor * scale * ⟦PI⟧ *", "1.0",
     MITSUBA_FEATURES + "projectors_have_a_constant_irradiance"),
    ("panes of spotlights that are mirrored", "formats/mitsuba/projectors.rs", "self.add_pane_quad(&frame, ⟦[-half, half]⟧, [-half, half]", "[half, -half]",
     MITSUBA_FEATURES + "textured_spots_have_a_pane"),
    ("gradients of grids in voxels", "formats/mitsuba/sdf_grids.rs", "(gradient(corners, at) * ⟦scale⟧)", "DVec3::ONE",
     MITSUBA + "sdf_grids::tests::planes_are_exact_and_face_outward"),
    ("offsets of serialized meshes with 8 bytes in version 3", "assets/mesh/serialized.rs", "let offset_bytes = if ⟦version == 3⟧ { 4 } else { 8 };", "false",
     "assets::mesh::serialized::tests::all_versions_support_parts"),
    ("panoramas with half the range of elevations", "world/camera.rs", "sin_cos_f64(⟦FRAC_PI_2⟧ * place.y);", "0.5 * FRAC_PI_2",
     PROJECTIONS + "panorama_directions_match_environment_maps"),
    ("fisheyes that are linear in the sine of the angle", "world/camera.rs", "sin_cos_f64(⟦radius.min(1.0) * half_fov⟧);", "(radius.min(1.0) * half_fov.min(1.0)).asin()",
     PROJECTIONS + "fisheye_angles_are_linear_in_the_radius"),
    ("fisheyes that fill the corners of the image", "world/camera.rs", "valid |= u32::from(⟦radius <= 1.0⟧) << lane;", "true",
     PROJECTIONS + "fisheye_is_black_outside_its_circle"),
    ("parallel rays that all start at the image center", "world/camera.rs", "self.position + (⟦center + self.right * place.x + self.up * place.y⟧)", "center",
     PROJECTIONS + "ball_silhouettes_have_their_closed_form_areas"),
    ("shifts by half their value", "world/camera.rs", "let shift = ⟦2.0⟧ * window.shift;", "1.0",
     PROJECTIONS + "shifted_image_is_a_crop_of_a_larger_one"),
    ("parallel rays without a footprint", "world/camera.rs", "PixelFootprint { width: ⟦per_row(2.0 * half_height)⟧, spread: 0.0 }", "0.0",
     PROJECTIONS + "orthographic_footprints_ignore_distance"),
    ("panorama depth along the view axis", "world/camera.rs", "Projection::Fisheye { .. } => ⟦arm.length()⟧,", "arm.dot(self.forward)",
     PROJECTIONS + "panorama_depth_is_distance_from_camera"),
    ("mirrored columns that are off by one", "integrators/transport/tile.rs", "*x = ⟦(width - 1).wrapping_sub(*x)⟧;", "width.wrapping_sub(*x)",
     PROJECTIONS + "mirrored_images_are_flipped_exactly"),
    ("clicks that ignore mirroring", "integrators/settings.rs", "let x = if ⟦camera.is_mirrored()⟧ {", "false",
     PROJECTIONS + "clicks_hit_the_object_shown_at_the_pixel"),
    ("parallel rays that always start in air", "world/camera_interior.rs", "solids.retain(|body| ⟦body.is_covered || self.camera.may_start_rays_in(&body.bounds)⟧);", "false",
     PROJECTIONS + "parallel_rays_can_start_in_glass"),
    ("gain applied to data", "integrators/mod.rs", "PathAov::LitFraction | PathAov::TraversalCost => ⟦1.0⟧,", "settings.render.gain",
     PROJECTIONS + "gain_scales_light_but_not_data"),
    ("environments rotated backwards", "lights/infinite/environment.rs", "Self::Rotation(rotation) => (⟦rotation.transpose()⟧ * direction, 0.0),", "rotation",
     "lights::infinite::environment::tests::rotated_maps_move_with_their_axes"),
    ("environment samples that are not rotated", "lights/infinite/environment.rs", "Self::Rotation(rotation) => ⟦rotation * direction⟧,", "direction",
     "lights::infinite::environment::tests::sample_frequencies_match_the_pdf"),
    ("light samples that are not averaged", "integrators/direct/all_lights.rs",
     "self.contributions_before_occlusion(&samples, ⟦1.0 / count as f32⟧, simd);", "1.0",
     DIRECT + "estimators::light_samples_match_the_quadrature"),
    ("light samples without a cosine", "integrators/direct/all_lights.rs", "(⟦cosines[i]⟧ * share);", "1.0",
     DIRECT + "estimators::light_samples_match_the_quadrature"),
    ("BSDF samples without a cosine", "integrators/transport/scatter.rs", "let cosine_over_pdf = ⟦cosines[i] / pdfs[i]⟧;", "1.0 / pdfs[i]",
     DIRECT + "estimators::bsdf_samples_match_the_quadrature"),
    ("path weights that ignore the number of light samples", "integrators/direct/mis.rs",
     "power_heuristic_from_ratio(of_light * ⟦samples⟧ / pdf);", "1.0",
     DIRECT + "mis_weights::weights_of_both_techniques_sum_to_one"),
    ("path weights with the pdf of the other side", "integrators/direct/mis.rs",
     "let side = if ⟦of_light.dot(direction) > 0.0⟧ { Side::Back } else { Side::Front };\n        lights", "of_light.dot(direction) < 0.0",
     DIRECT + "mis_weights::weights_of_both_techniques_sum_to_one"),
    ("picked lights without their pick probability", "integrators/direct/light_tree.rs",
     "lane(&samples.weights, i) * ⟦pick.shares[i]⟧;", "1.0", DIRECT + "estimators::all_techniques_have_equal_means"),
    ("pick probabilities that ignore the number of picks", "integrators/direct/light_tree.rs", "1.0 / (share * ⟦count⟧));", "1.0",
     PICKS + "each_light_is_picked_once_on_average"),
    ("infinite lights outside the tree that are not sampled", "integrators/direct/light_tree.rs", "if ⟦selection.samples_infinite⟧ {", "false",
     DIRECT + "estimators::all_techniques_have_equal_means"),
    ("pooled shadow rays without occlusion", "integrators/direct/shadow_rays.rs", "for to in set_bit_lanes(⟦occluded⟧) {", "0",
     DIRECT + "occlusion::occluded_samples_contribute_nothing"),
    ("light from behind the surface", "integrators/direct/all_lights.rs", "let contributes = (⟦cosines[i] > 0.0⟧) &", "true",
     DIRECT + "occlusion::unlit_sides_are_never_sampled"),
    ("light from behind a perturbed normal", "integrators/transport/batch.rs", "let g = ⟦if g > 0.0 { g } else { 0.0 }⟧;", "g",
     "closed_forms::bumps::no_light_from_behind_the_shading_normal"),
    ("a sheet on glass that transmits into air", "integrators/transport/walk.rs", "far = ⟦crossing.far⟧;",
     "path.interiors", FROSTED + "sheet_on_glass_transmits_into_the_glass"),
    ("a sheet in front of glass that transmits into air", "integrators/transport/walk.rs",
     "Interaction::Opaque(&vertex, OpaqueSurfaceHit::Touching(touched), ⟦&far⟧)", "&path.interiors",
     FROSTED + "sheet_on_glass_transmits_into_the_glass"),
    ("energy gained in a denser medium", "integrators/transport/interface.rs", "⟦(eta * eta).min(1.0)⟧", "1.0",
     FROSTED + "sheet_on_glass_adds_no_light"),
    ("no photons for index-matched glass", "integrators/photons/mod.rs",
     "material.bsdf.has_delta() || ⟦material.bsdf.as_dielectric().is_some_and(is_passed)⟧", "false",
     FROSTED + "photons_pass_rough_glass_with_ior_1"),
    ("an EXR without its alpha", "assets/image/exr/channels.rs",
     "color: ColorChannels::Rgb([red?, green?, blue?]), alpha: ⟦self.alpha⟧", "None",
     "assets::image::tests::exr_alpha_is_read"),
    ("tangents that ignore the texture's rotation", "materials/texture/mapping.rs",
     "let by = ⟦moved.inverse_transform_vector(axis).as_vec2() / self.repeat⟧;", "axis.as_vec2() / self.repeat",
     "materials::normal_map::tests::slopes_rotate_with_the_texture"),
    ("triangles without error bounds", "geometry/triangle_list.rs", "let error = ⟦distance * size⟧;", "0.0",
     "accel::triangle_list_tests::decided_packets_match_single_rays"),
    ("hits on the wrong triangle of a quadrilateral", "geometry/triangle_list.rs", "(between & ⟦if over < 0.0 { TRUE } else { 0 }⟧)",
     "TRUE", "accel::triangle_list_tests::decided_packets_match_single_rays"),
    ("a closer candidate lost", "geometry/triangle_list.rs", "is_hit & ⟦(hits.t[i] < candidates.next[i])⟧;", "true",
     "accel::triangle_list_tests::decided_packets_match_single_rays"),
    ("triangles without margins", "geometry/triangle_list.rs", "let margin = ⟦slender⟧ * simd.mul_add_relaxed(", "0.0",
     "accel::triangle_list_tests::decided_packets_match_single_rays"),
    ("rays that start behind an adjacent face", "world/triangle_point.rs",
     "let is_near_edge = ⟦is_within_edge_margin(u, ac, bound)\n            | is_within_edge_margin(v, ab, bound)\n            | is_within_edge_margin(w, ac - ab, bound)⟧;", "false",
     "closed_forms::robust::no_ray_escapes_through_room_edges"),
    ("packet origins that differ from single ones", "world/mesh_packet.rs", "let doubtful = ⟦simd.movemask(&doubtful) & of⟧;", "0",
     "world::mesh_packet::tests::packet_surfaces_match_single_surfaces"),
    ("meshes that ignore their transform", "world/mesh_instance.rs", "let is_transformed = ⟦transform != Transform::IDENTITY⟧;", "false",
     "world::mesh_instance::tests::transformed_points_are_within_their_error_bounds"),
    ("the wrong intersection with a curved shape", "geometry/surface_of_revolution.rs", "[true, true] => ⟦(first == second).then_some(first)⟧,", "Some(first)",
     "geometry::cylinder::tests::distant_hits_use_the_correct_crossing"),
    ("packets that claim surfaces they do not contain", "integrators/transport/packet.rs", "found |= if ⟦is_filled⟧ { of }", "true",
     "closed_forms::touching::drink_in_a_glass_matches_layers"),
    ("closed glass that is never entered", "integrators/transport/crossing.rs", "return (None, ⟦known.filter_solids(is_only_recorded).entered(entered)⟧);",
     "known.filter_solids(is_only_recorded)", "closed_forms::glass::slab_and_ball_absorption_is_exact"),
    ("minimum and maximum over the wrong lanes", "accel/wide_bvh/simd/dispatch.rs", "_mm512_mask_loadu_ps(other, ⟦of as u16⟧, row.as_ptr())", "(of >> 1) as u16",
     "accel::wide_bvh::simd::dispatch::tests::reductions_are_equal_on_all_instruction_sets"),
    ("rays that hit the triangle they start on", "geometry/triangle_list.rs", "let is_left_out = ⟦is_sure & ((rays.start[i] == number) | (except[i] == number))⟧;",
     "is_sure & (rays.start[i] == number)", "accel::triangle_list_tests::decided_packets_match_single_rays"),
    ("cosine with a normal that faces away from the viewer", "integrators/transport/batch.rs",
     "let normal = ⟦bsdf.lobe_shading_normal(shading.normal, wo)⟧;", "shading.normal",
     MICROFACETS + "coarse_smooth_meshes_conserve_energy"),
    ("a boundary between equal indices", "integrators/transport/walk.rs",
     "let refracts = ⟦medium_ior(tile.world, near) != medium_ior(tile.world, &far)⟧;", "true",
     "closed_forms::touching::no_boundary_between_equal_iors"),
    ("a see-through emitter whose near side does not attenuate", "world/null_interaction.rs",
     "if ⟦source == GeometryOfLight::SeeThrough(hit.object) && hit.shape.t >= ray.t_max - end⟧ {",
     "source == GeometryOfLight::SeeThrough(hit.object)", NULL_INTERACTIONS + "half_opaque_lights_transmit_their_own_light"),
    ("a texel in place of its neighbor", "materials/texture/wrap.rs", "[self.wrap_index(first, size), self.wrap_index(⟦first + 1⟧, size)]",
     "first", "materials::texture::image::tests::bilinear_lookups_return_expected_values"),
    ("negative texel coordinates rounded toward zero", "materials/texture/image.rs",
     "towards_zero - ⟦i32::from(towards_zero as f32 > x)⟧", "0",
     "materials::texture::image::tests::bilinear_lookups_return_expected_values"),
    ("a mirror texture without filtering", "materials/mod.rs",
     "Bsdf::Mirror(mirror) => ⟦mirror.textures().collect()⟧,", "Vec::new()",
     "closed_forms::footprints::distant_boards_are_gray_for_every_key"),
    ("normal maps that ignore mirroring", "materials/texture/mapping.rs", "return [dpdu * ⟦sides.x⟧, dpdv * sides.y]",
     "1.0", "materials::normal_map::tests::slopes_are_mirrored_with_the_texture"),
    ("lobe rays without hard shadows", "integrators/direct/unshadowed.rs",
     "⟦self.tile.world.transmittance(&segment, source, &mut rays.lookups)⟧", "Vec3::ONE",
     "closed_forms::hard::metal_lobes_use_the_same_shadow_ray"),
    ("a solid with a light in it treated as unlit", "world/unlit_glass.rs",
     "closed.is_some_and(|bounds| ⟦!may_contain_light(bounds)⟧)", "!may_contain_light(bounds) || true",
     FROSTED + "only_closed_unlit_solids_are_dark_inside"),
    ("albedo fit below the lobe's albedo", "materials/lobe_albedo.rs", "terms[0] += ⟦missing.fold(0.0, f64::max)⟧;", "0.0",
     "materials::lobe_albedo::tests::polynomials_are_tight_upper_bounds"),
    ("1 % of energy gained per bounce", "integrators/transport/scatter.rs", "let cosine_over_pdf = ⟦cosines[i] / pdfs[i]⟧;",
     "1.01 * cosines[i] / pdfs[i]", GLOBAL + "furnace_sums_bounces_up_to_the_depth"),
    ("missing cosine", "integrators/transport/scatter.rs", "let cosine_over_pdf = ⟦cosines[i] / pdfs[i]⟧;",
     "1.0 / pdfs[i]", GLOBAL + "integrating_sphere_has_uniform_indirect_light"),
    ("Russian roulette without reweighting", "integrators/transport/scatter.rs", "let factor = ⟦lane(&scattered.factors, i) / chance⟧;",
     "lane(&scattered.factors, i)", GLOBAL + "furnace_sums_bounces_up_to_the_depth"),
    ("Russian roulette that depends on the AOV", "integrators/transport/scatter.rs", "let chance = ⟦continuation.survival_probability(scattered.roulette_throughput[i])⟧;",
     "continuation.survival_probability(scattered.factors[0][i])", GLOBAL + "path_components_add_up"),
    ("emitters hit by paths without MIS weight", "integrators/direct/mis.rs", "if ⟦!(pdf > 0.0)⟧ {",
     "true", GLOBAL + "direct_light_of_path_matches_whitted"),
    ("light samples without MIS weight", "integrators/direct/mis.rs",
     "weights[i] = ⟦if start & 1 << i != 0 { weight } else { 1.0 }⟧;",
     "1.0", GLOBAL + "direct_light_of_path_matches_whitted"),
    ("lobe rays without MIS weight", "integrators/direct/mis.rs",
     "radiance * ⟦power_heuristic_from_ratio(self.light_pdf(ray, from_normal, (hit, normal)) / pdf)⟧", "1.0",
     GLOBAL + "sharp_highlight_has_low_variance"),
    ("MIS weight for an emitter behind glass", "integrators/transport/ray.rs",
     "Self { pdf: ⟦0.0⟧, roulette_throughput: self.roulette_throughput * part",
     "self.pdf", GLOBAL + "paths_find_light_behind_glass"),
    ("a background that illuminates", "integrators/path/emission.rs", "if ⟦path.state.only_specular_before⟧ {\n            let background",
     "true", GLOBAL + "background_is_visible_only_in_mirrors"),
    ("one bounce too few", "integrators/transport/scatter.rs", "let continues = ⟦depth + 1 < max_depth⟧",
     "depth + 2 < max_depth", GLOBAL + "furnace_sums_bounces_up_to_the_depth"),
    ("glass that reflects too much", "integrators/transport/walk.rs", "Dimension::Fresnel).x < ⟦reflectance⟧\n",
     "reflectance + 0.05", GLOBAL + "path_follows_mirrors_and_glass_like_whitted"),
    ("a wrong glossy pdf", "materials/bxdfs/phong/lobes.rs", "let glossy = ⟦(self.shininess + 1.0) * (0.5 * FRAC_1_PI)⟧ * gloss;",
     "(self.shininess + 2.0) * (0.5 * FRAC_1_PI)", "materials::bxdfs::phong::lobes::tests::glossy_samples_follow_the_pdf"),
    ("a pane with one reflecting side", "materials/thin_dielectric.rs", "⟦2.0 * side / (1.0 + side)⟧", "side",
     NULL_INTERACTIONS + "pane_transmits_by_angle"),
    ("partial opacity that blocks shadow rays", "materials/mod.rs", "through * there + ⟦Vec3::splat(1.0 - there)⟧", "Vec3::ZERO",
     NULL_INTERACTIONS + "shadows_multiply_transmittances"),
    ("a MIS weight with the distance from a pane", "integrators/transport/walk.rs", "path.ray.origin = ⟦self.origin⟧;",
     "path.ray.origin", NULL_INTERACTIONS + "light_passes_through_panes"),
    ("an emitter's back weighted as its front", "lights/area/mod.rs", "Side::Back => ⟦LightHitPoint { normal: -hit.normal, ..*hit }⟧",
     "*hit", TWO_SIDED + "flat_two_sided_lights_are_symmetric"),
    ("textures rotated the wrong way", "materials/texture/mapping.rs", "DVec2::new(⟦by.x * cos - by.y * sin⟧,",
     "by.x * cos + by.y * sin", "materials::texture::image::tests::coordinates_repeat_then_rotate_then_translate"),
    ("triangle waves without a corner", "materials/texture/stripes.rs", "x.min(⟦1.0 - x⟧)", "0.5",
     STRIPES + "filtered_tones_equal_the_integral"),
    ("the second color at the corner", "materials/texture/stripes.rs", "(⟦0.5 - 0.5 * wave⟧) as f32", "0.5 + 0.5 * wave",
     STRIPES + "first_tone_is_at_the_corner"),
    ("slopes of a checker that ignore the other axis", "materials/texture/stripes.rs", "wave_slope(point.x, extents.x) * ⟦y⟧,", "1.0",
     STRIPES + "slopes_are_derivatives_of_the_filtered_tone"),
    ("footprints that ignore the rotation of a pattern", "materials/texture/mapping.rs",
     "⟦self.moved.as_ref().map_or(axis, |moved| moved.transform_vector(axis))⟧", "axis",
     STRIPES + "rotated_footprints_filter_along_the_pattern"),
    ("gradients without the slope of the blend", "materials/texture/noise.rs", "blended + ⟦quintic_derivative(self.at[axis])⟧ *", "0.0",
     NOISE + "gradient_is_the_derivative"),
    ("octaves of equal weight", "materials/texture/noise.rs", "weight: (⟦scale⟧ / total) as f32", "1.0",
     NOISE + "octaves_have_half_the_size_and_weight"),
    ("octaves that do not fade", "materials/texture/noise.rs",
     "let fade = ⟦if width > 0.0 { above * above * (3.0 - 2.0 * above) } else { 1.0 }⟧;", "1.0",
     NOISE + "octaves_fade_below_the_footprint"),
    ("the same gradients in every octave", "materials/texture/noise.rs", "let key = hash(⟦seed | u64::from(number)⟧);", "seed",
     NOISE + "seeds_and_octaves_are_independent"),
    ("noise cut off without its faded octaves", "materials/texture/pattern.rs", "let half_width = ⟦0.5⟧ * (second - first)", "0.0",
     "materials::texture::pattern::tests::coverage_of_noise_survives_the_filter"),
    ("bumps of noise in the wrong coordinates", "materials/texture/pattern.rs", "(⟦object.from_world.transpose()⟧ * gradient)",
     "object.from_world", "materials::texture::pattern::tests::noise_gradients_follow_the_transform"),
    ("object footprints in world units", "materials/footprint.rs", "(⟦self.from_world⟧ * along).length()", "DMat3::IDENTITY",
     "materials::footprint::tests::object_footprints_scale_with_the_shape"),
    ("noise in world coordinates", "scene/description/shape.rs",
     "let placed = ⟦self.placement.as_ref().map_or(Transform::IDENTITY, |placed| placed.to_transform())⟧;", "Transform::IDENTITY",
     "closed_forms::procedural::noise_is_fixed_to_the_shape"),
    ("lights that ignore the coordinates of the shape", "lights/area/emission_modulation.rs",
     "let object_frame = ⟦self.terms.iter().any(is_used)⟧.then(", "false", "closed_forms::procedural::noisy_lights_match_a_quadrature"),
    ("a lobe's albedo off by 1 %", "materials/bxdfs/phong/lobes.rs", "1.0 / (⟦f64::from(self.shininess) + 1.0⟧)",
     "f64::from(self.shininess) * 0.99 + 1.0", "materials::bxdfs::phong::lobes::tests::glossy_samples_follow_the_pdf"),
    ("a lobe sampled on the wrong side", "materials/bxdfs/phong/lobes.rs", "let local = ⟦Vec3::new(sine * cos_phi, sine * sin_phi, cosine)⟧;",
     "Vec3::new(sine * cos_phi, sine * sin_phi, -cosine)", "materials::bxdfs::phong::lobes::tests::combined_lobe_samples_follow_the_pdf"),
    ("diffuse lobe sampled too often", "materials/bxdfs/phong/lobes.rs", "let is_diffuse = ⟦lobe < self.diffuse_probability()⟧;",
     "lobe < self.diffuse_probability() * 1.05", "materials::bxdfs::phong::lobes::tests::combined_lobe_samples_follow_the_pdf"),
    ("a lobe without its normalization", "materials/bxdfs/phong/mod.rs", "self.specular * ⟦((self.shininess + 2.0) / (2.0 * PI))⟧",
     "1.0", "materials::bxdfs::phong::tests::glossy_lobe_has_the_exact_value"),
    ("a rectangle's pdf off by 1 %", "lights/area/quad.rs", ".map(|spherical| ⟦1.0 / spherical.solid_angle⟧)",
     "1.01 / spherical.solid_angle", "lights::tests::sample_pdf_equals_pdf_of_hit"),
    ("a light's probability off by a tenth", "lights/tree/mod.rs", "if total > 0.0 { ⟦((self.0[child] - before) / total) as f32⟧ }",
     "1.1 * ((self.0[child] - before) / total) as f32", "lights::tree::tests::pick_probabilities_are_exact_and_sum_to_one"),
    ("lights sampled below the horizon", "lights/tree/node.rs", "let sum = ⟦straight + sin[i]⟧;",
     "1.0", "lights::tree::tests::noncontributing_lights_are_not_picked"),
    ("light bounds treated as points", "lights/tree/node.rs", "else { beyond }) + ⟦sin[i]⟧;",
     "0.0", "lights::tree::tests::spotlights_in_a_column_can_always_be_picked"),
    ("path weights as if all lights were sampled", "integrators/direct/mis.rs",
     "* ⟦lights.expected_sample_counts(self.behavior.receivers, ray.origin, normal).for_light(number)⟧", "1.0",
     MANY + "divided_light_keeps_sharp_highlight"),
    ("a kernel without its normalization", "integrators/photons/map.rs", "⟦2.0 / (std::f32::consts::PI * (self.radius * self.radius))⟧",
     "1.0 / (std::f32::consts::PI * (self.radius * self.radius))", PHOTONS + "integrating_sphere_has_uniform_photon_light"),
    ("a photon counted twice", "integrators/photons/gather.rs", "⟦indirect && row.after_gloss & 1 << i != 0⟧",
     "indirect", PHOTONS + "photons_match_path_with_light_in_glass"),
    ("skipped photon lookups without reweighting", "integrators/photons/gather.rs", 
     "let factor = ⟦coverage_factor(tile, (row, i), &look, photon, map.radius()) / chance⟧;",
     "coverage_factor(tile, (row, i), &look, photon, map.radius())",
     PHOTONS + "photons_match_path_with_light_in_glass"),
    ("a caustic that is 1 % too bright", "integrators/photons/emit/initial_rays.rs", "throughput: ⟦emitted.flux * tracing.flux_scale⟧,",
     "emitted.flux * (1.01 * tracing.flux_scale)", CAUSTICS + "photon_light_is_uniform_up_to_floor_edges"),
    ("a caustic that is 3 % too dark", "integrators/photons/emit/initial_rays.rs", "throughput: ⟦emitted.flux * tracing.flux_scale⟧,",
     "emitted.flux * (0.97 * tracing.flux_scale)", CAUSTICS + "ring_caustics_match_path"),
    ("a kernel radius that does not shrink", "integrators/photons/mod.rs", "(f64::from(radius) * ⟦shrunk⟧) as f32);", "1.0",
     CAUSTICS + "photon_light_is_uniform_around_a_box"),
    ("unbounded radii", "integrators/photons/mod.rs", "Ok(⟦largest.min(radius * (wanted / (NEAR * step as f32)).sqrt())⟧)",
     "radius * (wanted / (NEAR * step as f32)).sqrt()", "integrators::photons::tests::first_radius_is_bounded_by_the_scene"),
    ("photons through a wall", "integrators/photons/occlusion.rs", "if ⟦!is_blocked(from, to)⟧ {", "true", CAUSTICS + "photons_do_not_leak_under_a_wall"),
    ("requests that wait for photons", "pipeline/stages/photons.rs", "Err(RecvTimeoutError::Timeout) => ⟦tick()⟧,", "()",
     "pipeline::tests::photons::commands_are_handled_during_first_photon_pass"),
    ("a time limit ignored while photons are traced", "pipeline/render/scheduler.rs",
     "numbers.clone())?;\n            if ⟦self.is_over_time⟧ {", "false",
     "pipeline::tests::photons::time_limit_ends_a_photon_pass"),
    ("a first image without photons", "pipeline/render/scheduler.rs", "coarse.trace_coarse_image(⟦maps.as_ref()⟧, width", "None",
     "pipeline::tests::photons::first_preview_does_not_wait_for_photons"),
    ("unbounded photon map cache", "pipeline/stages/photons.rs", "let has_room = ⟦self.cached_bytes() + pass.memory_bytes() <= MAX_KEPT_BYTES⟧;",
     "true", "pipeline::tests::photons::maps_are_kept_while_there_is_room"),
    ("no cache for the previous scene", "pipeline/prepare/mod.rs", "oldest_request_to_keep(candidates, ⟦MAX_SPARE_BYTES⟧)", "0",
     "pipeline::tests::switching::switching_back_reuses_trees_and_textures"),
    ("unbounded cache of previous scenes", "pipeline/cache.rs", "⟦total <= max_bytes⟧", "true",
     "pipeline::cache::tests::oldest_scene_is_evicted_entirely"),
    ("no photons aimed at glass from mesh files", "integrators/photons/mod.rs", "own.balls.extend(⟦object.bounding_sphere()⟧);",
     "object.bounding_sphere().filter(|_| object.mesh().is_none())", PHOTONS + "photons_are_aimed_at_glass_from_mesh_file"),
    ("photons without the adjoint correction", "integrators/photons/emit.rs",
     "let counts = ⟦row.adjoint_photon_weight(i, -rays[i].ray.direction)⟧;", "1.0",
     PHOTONS + "photons_match_path_on_smooth_meshes"),
    ("photon roulette without reweighting", "integrators/photons/emit/roulette.rs", "ray.throughput /= ⟦chance⟧;",
     "1.0", PHOTONS + "stored_photons_carry_emitted_power"),
    ("photons that arrive from behind", "integrators/photons/map.rs",
     "near[i] &= if ⟦faces⟧ { TRUE } else { 0 };", "true",
     "integrators::photons::map::tests::kernel_sums_to_one_and_excludes_deep_photons"),
    ("emitters behind glass counted twice", "integrators/path/emission.rs", "if ⟦self.is_light_counted_elsewhere(path)⟧ {", "false",
     PHOTONS + "furnace_with_emitter_in_glass_is_uniform"),
    ("photons with one bounce too many", "integrators/photons/gather.rs", "max_depth.checked_sub(⟦depth + 1⟧)", "depth",
     PHOTONS + "photons_match_path_with_light_in_glass"),
    ("MIS weights that depend on the vertex's lobe", "integrators/direct/light_tree.rs",
     "row.weighed[i] = ⟦without.map_or(probability, |without| without.probability(light))⟧;", "probability",
     MANY + "divided_light_keeps_sharp_highlight"),
    ("a pooled ray that occludes another", "integrators/direct/shadow_rays.rs", ".traced &= !(1 << ⟦(ray % PACKET_SIZE)⟧);",
     "((ray ^ 1) % PACKET_SIZE)", MANY + "every_light_kind_matches_the_full_sum"),
    ("a textured quad's pdf off by a tenth", "lights/area/textured_quad.rs",
     "let quad_pdf = ⟦self.quad.pdf_by_solid_angle(to_corner).unwrap_or(1.0 / by_area)⟧;",
     "1.1 * self.quad.pdf_by_solid_angle(to_corner).unwrap_or(1.0 / by_area)",
     "lights::variance_tests::textured_quad_pdf_matches_its_samples"),
    ("a microfacet distribution without π", "materials/microfacet.rs", "self.squared * self.squared * ⟦FRAC_1_PI⟧ / (product", "1.0",
     METAL + "values_match_the_formulas_and_are_reciprocal"),
    ("masking with the terms of the wrong direction", "materials/microfacet.rs",
     "let value = distribution / (2.0 * ⟦(self.cosine * other.slope + other.cosine * self.slope)⟧);",
     "(self.cosine * self.slope + other.cosine * other.slope)", METAL + "values_match_the_formulas_and_are_reciprocal"),
    ("half-vector pdf used for directions", "materials/microfacet.rs",
     "let pdf = distribution / (⟦2.0⟧ * (self.cosine + self.slope));", "0.5", PLASTIC + "samples_follow_the_pdf"),
    ("a wrong metal pdf", "materials/microfacet.rs",
     "let both = ⟦self.cosine * other.slope + other.cosine * self.slope⟧;",
     "self.cosine * other.slope", METAL + "samples_follow_the_pdf"),
    ("normals stretched along the wrong axis", "materials/microfacet.rs", "let shrunk = Vec3::new(⟦along_u * normal.x⟧,", "along_v * normal.x",
     METAL + "samples_follow_the_pdf"),
    ("sampling of invisible normals", "materials/microfacet.rs", "let part = ⟦0.5 * (1.0 + view.z)⟧;", "1.0",
     METAL + "samples_follow_the_pdf"),
    ("a Beckmann distribution of slopes instead of normals", "materials/microfacet.rs",
     "let value = ⟦cosine * cosine⟧ * exp2(slope * -LOG2_E)", "1.0", METAL + "beckmann_values_match_the_formulas"),
    ("Beckmann masking without the Gaussian", "materials/microfacet/beckmann.rs",
     "cosine * erf + ⟦sine * (0.5 * FRAC_2_SQRT_PI) * gaussian⟧", "0.0",
     METAL + "beckmann_values_match_the_formulas"),
    ("visible slopes sampled for the wrong view direction", "materials/microfacet/beckmann.rs",
     "let weight = ⟦sine * (0.25 * FRAC_2_SQRT_PI)⟧;", "1.1 * sine * (0.25 * FRAC_2_SQRT_PI)", METAL + "beckmann_samples_follow_the_pdf"),
    ("too few Newton steps for visible slopes", "materials/microfacet/beckmann.rs", "for _ in 0..⟦NEWTON_STEPS⟧ {", "0",
     METAL + "beckmann_samples_follow_the_pdf"),
    ("slopes rotated the wrong way", "materials/microfacet/beckmann.rs", "Vec3::new(⟦across * y - along * x⟧,", "-across * y - along * x",
     METAL + "beckmann_samples_follow_the_pdf"),
    ("a Beckmann albedo without shadowing", "materials/lobe_albedo/beckmann.rs", "(1.0 + masked + ⟦shadowed⟧)", "0.0 * shadowed",
     PLASTIC + "white_beckmann_plastic_reflects_all_light"),
    ("a black back that reflects in packets", "integrators/transport/packet.rs", "self.row.used &= ⟦front | !plain.black_from_behind⟧;", "u32::MAX",
     "closed_forms::one_sided::only_the_front_reflects"),
    ("a black back that reflects", "materials/mod.rs", "ReflectingSides::Front => ⟦is_front⟧,", "true",
     "closed_forms::one_sided::only_the_front_reflects"),
    ("photons expected on a black back", "integrators/photons/coverage.rs", "is_stored && ⟦material.scatters_on_side(is_front)⟧", "true",
     CAUSTICS + "photon_light_is_uniform_up_to_black_backs"),
    ("diffuse transmission without π", "materials/bxdfs/translucent/mod.rs", "⟦self.transmission * FRAC_1_PI⟧", "self.transmission",
     "closed_forms::translucent::light_from_behind_is_exact"),
    ("a reflection pdf that ignores transmission", "materials/bxdfs/translucent/bxdf.rs",
     "LobesToSample::All => ⟦(1.0 - self.transmission_probability) * reflected⟧,", "reflected",
     "materials::bxdfs::translucent::tests::samples_on_both_sides_follow_the_pdf"),
    ("no random choice between the sides", "integrators/transport/scatter.rs", "let [lobe, _] = if ⟦row.bsdf.uses_lobe_choices()⟧ {",
     "row.bsdf.has_narrow_lobes()", "closed_forms::translucent::techniques_agree_on_light_from_behind"),
    ("unlimited diffuse transmission", "materials/bxdfs/principled/mod.rs",
     "let transmitted = ⟦lookup.color(&inputs.diffuse_transmission).min(Vec3::ONE - color)⟧;", "lookup.color(&inputs.diffuse_transmission)",
     PRINCIPLED + "diffuse_lobes_are_attenuated_alike"),
    ("diffuse transmission sampled too rarely", "materials/bxdfs/principled/bxdf.rs",
     "LobesToSample::All => (1.0 - transmission_probability, ⟦view.diffuse_transmission_probability⟧),",
     "0.7 * view.diffuse_transmission_probability", PRINCIPLED + "diffuse_transmission_samples_follow_the_pdf"),
    ("η and k swapped", "materials/bxdfs/conductor/mod.rs", "let exact = ⟦fresnel_conductor(cosine, first, second)⟧;", "fresnel_conductor(cosine, second, first)",
     METAL + "element_reflectances_match_reference_values"),
    ("a coat's η inverted", "materials/coat.rs", "fresnel_dielectric_from_outside(cosine, ⟦self.ior⟧)", "1.0 / self.ior",
     PLASTIC + "values_match_the_formulas_and_are_reciprocal"),
    ("a coat that attenuates light only once", "materials/bxdfs/plastic/bxdf.rs", "if cosine > 0.0 { ⟦view.transmittance * entering⟧ } else", "view.transmittance",
     PLASTIC + "white_furnace_and_albedos_match_quadrature"),
    ("internal reflection of a coat lost", "materials/lobe_albedo.rs", "diffuse / (Vec3::ONE - ⟦diffuse * returned⟧)", "Vec3::ZERO",
     PLASTIC + "white_furnace_and_albedos_match_quadrature"),
    ("an albedo off by 1 %", "materials/lobe_albedo.rs", "sum += ⟦area⟧ * reflectance(between) * left;", "1.01 * area",
     PLASTIC + "white_furnace_and_albedos_match_quadrature"),
    ("a clear coat that does not attenuate its base", "materials/bxdfs/coated/bxdf.rs",
     "let both = if cosine > 0.0 { ⟦view.transmittance * (1.0 - albedo)⟧ }", "1.0", COATED + "values_match_the_formulas_and_are_reciprocal"),
    ("a clear coat that absorbs along the unrefracted path", "materials/coat.rs", "let squared = ⟦(self.ior - 1.0) * (self.ior + 1.0)⟧ + cosine * cosine;",
     "0.0", COATED + "values_match_the_formulas_and_are_reciprocal"),
    ("light lost between a clear coat and its base", "materials/coat.rs", "(Vec3::ONE - ⟦base.min(Vec3::ONE) * coat⟧).max(least)", "Vec3::ZERO",
     COATED + "albedos_over_white_match_quadrature"),
    ("clear coat sampled too often", "materials/bxdfs/coated/bxdf.rs", "choose_vec3_by_bool(choice < ⟦coat⟧, coated, below)", "1.3 * coat",
     COATED + "samples_follow_the_pdf"),
    ("base lobes chosen with a random number that is not remapped", "materials/bxdfs/coated/bxdf.rs", "let rest = ⟦(choice - coat)⟧ / base.max(f32::MIN_POSITIVE);", "choice",
     COATED + "samples_follow_the_pdf"),
    ("a clear coat whose tint ignores its weight", "materials/coat.rs", "(lookup.color(tint).min(Vec3::ONE) - Vec3::ONE) * ⟦weight⟧;", "1.0",
     COATED + "values_match_the_formulas_and_are_reciprocal"),
    ("a mirror that ignores its coat", "materials/specular_over_base.rs", "self.coat.as_ref().map_or(Vec3::ONE, |coat| ⟦coat.two_way_transmittance(at, cosine, base, lookups)⟧)", "{ let _ = (coat, base); Vec3::ONE }",
     "closed_forms::coats::coated_mirrors_match_the_closed_form"),
    ("a blend with swapped weights", "materials/blend.rs", "if *u < ⟦weight⟧ {", "1.0 - weight", "closed_forms::blends::constant_blends_are_weighted_means"),
    ("nested blends whose choices are correlated", "materials/blend.rs", "*u = ⟦(*u - weight) / (1.0 - weight)⟧;", "*u", "closed_forms::blends::constant_blends_are_weighted_means"),
    ("light samples of a blend with the wrong weights", "lights/area/emission_modulation.rs", "if self.is_second { second } else { ⟦1.0 - second⟧ }", "1.0",
     "closed_forms::blends::blends_emit_the_weighted_sum"),
    ("shadow rays with the unweighted sum of a blend", "materials/blend.rs", "sum += value(part, lookups) * ⟦weight⟧;", "1.0",
     "closed_forms::blends::shadow_rays_use_mean_transmittance_of_blends"),
    ("photons lost on the other part of a blend", "integrators/photons/emit/interactions.rs", "⟦vertex.surface_material.presence_probability(&at, &is_stored, lookups)⟧", "1.0",
     CAUSTICS + "photons_on_blends_represent_all_that_arrive"),
    ("selection of the δ lobe without reweighting", "integrators/path/interactions.rs",
     "let base_factor = if both { 1.0 } else { ⟦1.0 / (1.0 - probability)⟧ };", "1.0", MICROFACETS + "white_plastic_is_invisible_in_a_furnace"),
    ("a smooth coat that reflects too many photons", "integrators/photons/emit/interactions.rs", "let part = ⟦if chooses { 1.0 } else { probability }⟧;", "1.0",
     MICROFACETS + "photons_match_path_on_coats_and_metals"),
    ("missing Jacobian of refraction", "materials/bxdfs/rough_dielectric/bxdf.rs",
     "transmittance(cosines, indices) / ⟦half.squared⟧;", "1.0", ROUGH_GLASS + "transmission_matches_the_formulas"),
    ("Jacobian of the wrong side", "materials/bxdfs/rough_dielectric/bxdf.rs", "let value = value * (⟦self.far * self.far⟧);",
     "self.near * self.near", ROUGH_GLASS + "two_sided_albedos_match_quadrature"),
    ("η swapped in transmission", "materials/bxdfs/rough_dielectric/bxdf.rs", "let indices = ⟦[self.near, self.far]⟧;\n        let (half, sum)",
     "[self.far, self.near]", ROUGH_GLASS + "transmission_matches_the_formulas"),
    ("η swapped in reflection", "materials/bxdfs/rough_dielectric/bxdf.rs",
     "fresnel_dielectric_any_eta(half.cosine_to_either_direction(), ⟦self.far / self.near⟧);", "self.near / self.far",
     ROUGH_GLASS + "reflection_matches_the_formulas"),
    ("refraction with an inverted η", "materials/bxdfs/rough_dielectric/bxdf.rs", "⟦refract_at(half, view.wo, eta)⟧ } else {",
     "refract_at(half, view.wo, 1.0 / eta)", ROUGH_GLASS + "samples_on_both_sides_follow_the_pdf"),
    ("masking on the wrong side of glass", "materials/bxdfs/rough_dielectric/bxdf.rs", "let lit = ⟦if THROUGH { -view.normal } else { view.normal }⟧;", "view.normal",
     ROUGH_GLASS + "transmission_matches_the_formulas"),
    ("a two-sided vertex that keeps its medium", "integrators/transport/scatter.rs",
     "(&row.beyond, ⟦row.interiors_beyond[i]⟧, -lane(&row.normal, i))", "row.interiors[i]",
     FROSTED + "photons_match_path_through_rough_glass"),
    ("a masking ratio with the wrong Λ", "materials/bxdfs/rough_dielectric/bxdf.rs", "light.cosine * ⟦(eye.cosine + eye.slope)⟧",
     "(eye.cosine + light.slope)", ROUGH_GLASS + "two_sided_samples_match_one_sided_samples"),
    ("box edges treated as faces", "geometry/cuboid.rs", "⟦are_far.into_iter().filter(|&is_far| is_far).count() == 2⟧",
     "true", "isolated::isolated_regions_match_the_full_search"),
    ("paths that continue on both sides of glass", "materials/bxdfs/rough_dielectric/bxdf.rs", "choose_vec3_by_bool(⟦is_reflected == THROUGH⟧, unused, wi)", "false",
     ROUGH_GLASS + "paths_continue_on_exactly_one_side"),
    ("missing Fresnel reflectance of glass", "materials/bxdfs/rough_dielectric/bxdf.rs",
     "return ⟦reflectance⟧\n                * eye.torrance_sparrow_without_fresnel", "1.0", ROUGH_GLASS + "samples_on_both_sides_follow_the_pdf"),
    ("a boundary that transmits 1 % too much", "materials/fresnel.rs", "⟦2.0⟧ * ((n_1 * n_2) * (cos_1 * cos_2)) * inverse",
     "2.02", ROUGH_GLASS + "two_sided_albedos_match_quadrature"),
    ("transmission with F in place of 1 − F", "materials/bxdfs/principled/bxdf.rs",
     "let rest = Vec3::ONE - ⟦(facets + (Vec3::splat(grazing) - facets) * weight)⟧;", "(facets + (Vec3::splat(grazing) - facets) * (1.0 - weight))",
     PRINCIPLED + "transmission_is_the_mirrored_specular_lobe"),
    ("transmission sampled too often", "materials/bxdfs/principled/bxdf.rs",
     "LobesToSample::All => (⟦1.0 - transmission_probability⟧,", "1.0 - 1.3 * transmission_probability", PRINCIPLED + "samples_on_both_sides_follow_the_pdf"),
    ("transmitted light from the wrong side", "integrators/transport/vertex.rs", "sides: ⟦self.sides.map(turned)⟧,",
     "self.sides", FROSTED + "techniques_agree_on_transmitted_light"),
    ("medium of the wrong side", "integrators/path/vertices.rs", "path, interiors: ⟦far⟧, place, vertex: &vertex,", "&path.interiors",
     FROSTED + "techniques_agree_on_transmitted_light"),
    ("medium in front of a sheet used behind it", "integrators/path/vertices.rs", "path, interiors: ⟦far⟧, place, vertex, shading, bsdf: &bsdf", "&path.interiors",
     FROSTED + "sheet_on_glass_transmits_into_the_glass"),
    ("a camera that ignores compound solids", "world/camera_interior.rs", "material.filter(|_| ⟦votes > 0⟧)", "false",
     "closed_forms::bodies::camera_inside_split_solid_is_in_glass"),
    ("photons that ignore compound solids", "integrators/photons/emit/initial_rays.rs", "let material = ⟦world.glass_material_around_point(body, point, emitter())⟧?;", "None",
     "closed_forms::bodies::light_inside_split_solid_emits_photons"),
    ("roughness of the earlier touching glass", "integrators/transport/crossing.rs",
     "let later = ⟦near.medium_glass().max(far.medium_glass())⟧?;", "near.medium_glass().or(far.medium_glass())",
     FROSTED + "later_touching_glass_sets_the_roughness"),
    ("refracted photons without the 1/η² factor", "integrators/photons/emit/interactions.rs", "            1.0 / ⟦(eta * eta)⟧\n", "1.0",
     FROSTED + "photons_scatter_to_both_sides_of_rough_glass"),
    ("photons that are not transmitted", "integrators/photons/emit.rs", "if ⟦self.open_behind.used != 0⟧ {", "false",
     FROSTED + "photons_scatter_to_both_sides_of_rough_glass"),
    ("a sky without the gradient at the horizon", "lights/infinite/sky/mod.rs",
     "let horizon = 1.0 + ⟦a * exp2(b / (height + 0.01))⟧;", "0.0", SKY + "radiances_match_the_published_model"),
    ("a sky whose aureole has the wrong exponent", "lights/infinite/sky/mod.rs",
     "let anisotropy = (1.0 + cos * cos) / ⟦(base * base.sqrt())⟧;", "base", SKY + "radiances_match_the_published_model"),
    ("sky pdfs that ignore the size of the rows", "lights/infinite/sky/mod.rs",
     "let extent = if row < ROWS { ⟦1.0 / ROWS as f32⟧ } else { 1.0 };", "1.0", SKY + "samples_have_the_pdf_of_their_direction"),
    ("a ground that the sun does not light", "lights/infinite/sky/mod.rs",
     "let lit = (irradiance * solid_angle + ⟦sun_irradiance⟧)", "DVec3::ZERO", SKY + "ground_reflects_the_light_of_sky_and_sun"),
    ("a sun without limb darkening", "lights/infinite/sky/sun.rs", "radiance * ⟦Vec3::from_array(limb)⟧", "Vec3::ONE",
     SKY + "sun_matches_the_published_model"),
    ("a sun that is visible below the horizon", "lights/infinite/sky/sun.rs", "if ⟦height < 0.0⟧ {", "false",
     SKY + "horizon_hides_the_lower_part_of_the_sun"),
    ("a wider sun with more irradiance", "lights/infinite/sky/sun.rs",
     "let scale = f64::from(sun_scale) * ⟦(one_minus_cos(model_angle) / one_minus_cos(sun_angle))⟧;", "1.0",
     SKY + "sun_irradiance_is_radiance_times_solid_angle"),
    ("a sun that does not rotate with its sky", "world/emitters.rs", "SkyFrame::new(⟦rotation * sky.sun⟧, rotation.y_axis);",
     "sky.sun", "closed_forms::sky::rotating_a_sky_equals_rotating_its_sun"),
    ("rough lobe rays counted on top of light samples", "integrators/direct/mis.rs",
     "Self::Paths | Self::NarrowPaths => ⟦1.0 / count as f32⟧,", "0.0", MICROFACETS + "techniques_agree_on_area_lights"),
    ("smooth vertices with a constant weight", "assets/mesh/subdivide/masks.rs", "(0.625 - ⟦center * center⟧) / n", "0.25",
     SUBDIVISION + "limits::cube_limits_match_powers_of_the_matrix"),
    ("control points that are not moved to the limit", "assets/mesh/subdivide/masks.rs", "let own = ⟦3.0 / (8.0 * neighbor_weight(count))⟧;", "1e9",
     SUBDIVISION + "limits::cube_limits_match_powers_of_the_matrix"),
    ("boundaries that are not splines", "assets/mesh/subdivide/masks.rs", "value * ⟦0.75⟧ + ends * 0.125", "0.8",
     SUBDIVISION + "boundaries::flat_grids_stay_flat_within_a_spline"),
    ("boundaries that are not moved to the limit", "assets/mesh/subdivide/masks.rs", "value * (2.0 / 3.0) + ends * (⟦1.0 / 6.0⟧)", "1.0 / 5.0",
     SUBDIVISION + "boundaries::flat_grids_stay_flat_within_a_spline"),
    ("single faces that shrink", "assets/mesh/subdivide/topology.rs", "vertex.is_corner || ⟦is_lone⟧ || is_fixed", "false",
     SUBDIVISION + "boundaries::vertices_of_a_single_face_stay"),
    ("normals from one tangent", "assets/mesh/subdivide/normals.rs", "along += *arm * ⟦sin⟧;", "sin.abs()",
     SUBDIVISION + "limits::normals_match_a_much_finer_mesh"),
    ("boundary normals without the ends", "assets/mesh/subdivide/normals.rs", "inner.fold(⟦ends * end_weight⟧, ", "DVec3::ZERO",
     SUBDIVISION + "boundaries::boundary_normals_match_many_refinements"),
    ("wide fans with ordinary edges", "assets/mesh/subdivide/masks.rs", "⟦0.5 - 0.25 * libm::cos(PI / f64::from(faces))⟧", "0.375",
     SUBDIVISION + "boundaries::boundary_normals_match_many_refinements"),
    ("seams that move at junctions", "assets/mesh/subdivide/weld.rs", "shape.is_corner(point) || ⟦seams[point as usize] >= 3⟧", "false",
     SUBDIVISION + "seams::a_box_of_six_charts_has_smooth_normals"),
    ("seams that split the surface", "assets/mesh/subdivide/weld.rs", "let number = &mut numbers[⟦first[vertex as usize]⟧ as usize];", "vertex",
     SUBDIVISION + "seams::seams_change_only_the_coordinates"),
    ("materials of the wrong faces", "assets/mesh/subdivide/mod.rs", "|triangle| materials[⟦triangle / copies⟧])", "triangle % materials.len()",
     SUBDIVISION + "results_do_not_depend_on_thread_count"),
    ("meshes cached without their level", "stages/meshes.rs", "key.add_usize(⟦file.subdivide as usize⟧);", "0",
     "stages::meshes::tests::subdivision_levels_are_cached_separately"),
    ("translucent glTF materials that keep their color", "formats/gltf/materials.rs", "let color = scaled(&material.color, ⟦1.0 - weight⟧);", "1.0",
     "gltf_materials::diffuse_transmission_equals_hand_written_one"),
    ("glTF blends with the wrong channel", "formats/gltf/materials.rs", 'self.add_blend(&base, parts, &through.weight, ⟦"a"⟧);', '"r"',
     "gltf_materials::diffuse_transmission_equals_hand_written_one"),
    ("coats of mesh files that do not cover emission", "world/file_materials.rs", "let coat = ⟦own.physical.as_ref()⟧.and_then(", "None",
     "models::physical_mtl_matches_principled_material"),
    ("metals in MTL files that are isotropic", "assets/mesh/mtl/material.rs", "let anisotropy = if ⟦physical.is_metal()⟧ {", "false",
     "assets::mesh::mtl::tests::pbr_statements_are_converted"),
    ("images of pbrt cameras that are not mirrored", "formats/pbrt/settings.rs", "if ⟦!is_mirroring(&matrix)⟧ {", "false",
     PBRT_FACTS + "left_handed_cameras_mirror_the_image"),
    ("fields of view along the height", "formats/pbrt/settings.rs", "libm::tan(fov.to_radians() * 0.5) * ⟦height⟧ * 0.5;", "2.0",
     PBRT_FACTS + "field_of_view_is_along_the_shorter_side"),
    ("exposure without the shutter", "formats/pbrt/settings.rs", "film.gain * ⟦exposure⟧;", "1.0",
     PBRT_FACTS + "iso_and_shutter_become_gain"),
    ("roughness that is never remapped", "formats/pbrt/materials.rs", "Some(if ⟦is_remapped⟧ {", "false",
     PBRT_FACTS + "roughness_is_remapped_by_default"),
    ("metals under coats as in air", "formats/pbrt/materials.rs", "TextureNode::Constant(DVec3::splat(⟦1.0 / coat_ior⟧))", "1.0",
     PBRT_FACTS + "conductors_are_copper_by_default"),
    ("spectra of lights that keep their luminance", "formats/pbrt/colors.rs", "xyz_to_linear_rgb(xyz / ⟦xyz.y⟧)", "1.0",
     PBRT + "colors::tests::emission_has_unit_luminance_unless_rgb"),
    ("fronts of meshes that ignore the normals", "formats/foreign/meshes.rs", "⟦self.triangle_cross_product(triangle).dot(sum) < 0.0⟧", "is_reversed",
     PBRT_FACTS + "fronts_of_emissive_meshes_follow_pbrt"),
    ("disks that ReverseOrientation does not turn", "formats/pbrt/shapes.rs", "let normal = if ⟦placement.is_reversed⟧ {", "false",
     PBRT_FACTS + "only_reverse_orientation_turns_spheres"),
    ("power of a whole mesh", "formats/pbrt/emitters.rs", "/ ⟦areas.len().max(1) as f64⟧;", "1.0",
     PBRT_FACTS + "power_of_area_lights_is_per_triangle"),
    ("two checker cells per unit", "formats/pbrt/textures.rs", "push_mapping(&mut keys, mapping, ⟦2.0⟧);", "1.0",
     PBRT_FACTS + "checker_cells_are_one_unit"),
    ("linear numbers of images", "formats/pbrt/textures.rs", "let is_integer = ⟦!has_float_extension(&image.file.text)⟧;", "false",
     PBRT_FACTS + "number_textures_decode_from_srgb"),
    ("reliefs of one unit", "formats/pbrt/bake.rs", "sign * ⟦image.factor.x⟧)", "1.0",
     PBRT_FACTS + "displacement_keeps_its_scale"),
    ("lower half of equal-area maps turned", "formats/pbrt/environment.rs", "(u, v) = ⟦(1.0 - v, 1.0 - u)⟧;", "(1.0 - u, 1.0 - v)",
     PBRT + "environment::tests::square_mapping_is_inverted"),
    ("small bright sources sampled coarsely", "formats/pbrt/environment.rs", "let radiance = if ⟦has_contrast(column, row)⟧ {", "false",
     PBRT + "environment::tests::small_sources_keep_their_power"),
    ("paths relative to the included file", "formats/pbrt/parser/mod.rs", "let path = ⟦self.folder.join(&name.text)⟧;",
     "self.open_files[self.open_files.len() - 1].with_file_name(&name.text)",
     PBRT_FACTS + "included_paths_are_relative_to_the_first_file"),
]


def crate_of(module):
    """The folder of the crate that contains a top-level module, or is one."""
    crates = list((COPY / "crates").iterdir())
    found = [crate for crate in crates if crate.name == module or (crate / "src" / module).is_dir()]
    if len(found) != 1:
        sys.exit(f"no crate, or more than one, contains {module}")
    return found[0]


def source(file):
    """The path of a file, given as a module path such as `materials/texture.rs`."""
    module, rest = file.split("/", 1)
    crate = crate_of(module)
    return crate / "src" / (rest if crate.name == module else file)


def copy_with_faults(selected):
    # Remove old sources, but keep the build.
    for entry in COPY.iterdir() if COPY.is_dir() else []:
        if entry.name != "target":
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in filter(None, tracked.stdout.decode().split("\0")):
        if (ROOT / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, COPY / name)
    places = {}
    for number, (fault, file, place, wrong, _) in enumerate(selected):
        places.setdefault((file, place), []).append((fault, number, wrong))
    for (file, place), faults in places.items():
        path = source(file)
        head, right, tail = re.split("[⟦⟧]", place)
        if path.read_text().count(head + right + tail) != 1:
            sys.exit(f"{faults[0][0]}: {file} does not contain `{place}` exactly once")
        chosen = right
        for _, number, wrong in faults:
            chosen = f'if crate::injected({number}) {{ {wrong} }} else {{ {chosen} }}'
        path.write_text(path.read_text().replace(head + right + tail, f"{head}({chosen}){tail}"))
    for lib in {crate_of(file.split("/")[0]) / "src" / "lib.rs" for _, file, *_ in selected}:
        lib.write_text(lib.read_text() + SWITCH)


def executables(profile):
    command = ["cargo", "test", "--profile", profile, "--workspace", "--tests", "--no-run", "--message-format=json"]
    # The copy needs its own target folder, as cargo would confuse its packages with the original ones.
    env = {**os.environ, "CARGO_TARGET_DIR": str(COPY / "target"), "RUSTFLAGS": os.environ.get("RUSTFLAGS", "")}
    built = subprocess.run(command, cwd=COPY, env=env, stdout=subprocess.PIPE, check=True)
    messages = [json.loads(line) for line in built.stdout.splitlines() if line.startswith(b"{")]
    return {m["target"]["name"]: m["executable"] for m in messages if m.get("executable") and m["profile"]["test"]}


def program_and_name(test):
    """The program that contains a test, and the test's name in it. Integration tests are named like their folder."""
    module = test.split("::")[0]
    for folder in [*COPY.glob("tests/*/"), *COPY.glob("crates/*/tests/*/")]:
        if (folder / module).is_dir() or (folder / f"{module}.rs").is_file():
            return folder.name, test
    crate = crate_of(module).name
    return f"glimt_{crate}", test.removeprefix(f"{crate}::") if crate == module else test


def passes(programs, test, fault=None):
    program, test = program_and_name(test)
    env = {**os.environ, "GLIMT_FAULT": "" if fault is None else str(fault)}
    run = subprocess.run([programs[program], "--exact", test], cwd=COPY, env=env, capture_output=True, text=True)
    if "1 passed" not in run.stdout and "1 failed" not in run.stdout:
        sys.exit(f"no such test: {test}\n{run.stdout}{run.stderr}")
    return run.returncode == 0


def main():
    profile, word = (sys.argv[1:] + ["dev", ""][len(sys.argv) - 1 :])[:2]
    selected = [row for row in FAULTS if word in row[1] or word in row[4]]
    copy_with_faults(selected)
    programs = executables(profile)
    for test in dict.fromkeys(row[4] for row in selected):
        if not passes(programs, test):
            sys.exit(f"{test} fails without a fault")
    missed = 0
    for number, (fault, _, _, _, test) in enumerate(selected):
        found = not passes(programs, test, number)
        missed += not found
        print(f"{'found ' if found else 'MISSED'}  {fault:45} {test}", flush=True)
    sys.exit(f"{missed} faults were not detected" if missed else 0)


if __name__ == "__main__":
    main()
