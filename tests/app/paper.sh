#!/usr/bin/env bash
# sonde paper: every claim has its figures, every figure and table is there, and what are laws hold: the flat probe needs
# more force, curves are convex, an impulse keeps momentum, GJK is linear. Times decide nothing.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

checks_of() { # CLAIM "CHECK...": the claim is complete and keeps the checks
  local claim=$1 check
  for key in section sentence done found verdict sample; do printf 'claims.%s.%s:text ' "$claim" "$key"; done
  printf 'claims.%s.samples>=1 ' "$claim"
  for check in $2; do printf 'claims.%s.%s ' "$claim" "$check"; done
}

list="kind=paper quick:bool holds>=12 not_tried<=1 sites>=16 third_measurements>=20 nodes>=5000"
list+=" $(checks_of nonlinear_curves 'concave<=0 stiffening>=2 verdict=holds')"
list+=" $(checks_of flat_needs_more 'least_ratio>=2 verdict=holds')"
list+=" $(checks_of heterogeneous 'correlation_bone>=0.9 correlation_bone<=1')"
list+=" $(checks_of few_unknowns 'paper_parameters>=33 paper_parameters<=33')"
list+=" $(checks_of five_percent 'stage2_percent>=10 stage3_percent<=1.4 stage3_mae_n<=0.12')"
list+=" $(checks_of error_distribution 'mae_over_sd<=0.7 normal_mae_over_sd>=0.797 normal_mae_over_sd<=0.799')"
list+=" $(checks_of start_avoids_minima 'same_optimum>=1 worst_rmse_ratio>=0.99')"
list+=" $(checks_of simplified_interaction 'mean_ratio<=0.9')"
list+=" $(checks_of linear_inconvenient 'ratio>=10 linear_percent>=20 eq1_percent<=2 verdict=holds')"
list+=" $(checks_of incompressible 'deepest_over_limit<=0.99 slope_ratio>=3 verdict=holds')"
list+=" $(checks_of two_probes_predict 'shear_third_percent<=2.6')"
list+=" $(checks_of two_probes_needed 'linear_from_point_percent>=5 point_from_linear_percent>=5')"
list+=" $(checks_of vein_compresses 'healthy_area<=0.11 chronic_area>=0.7 artery_area>=0.6')"
list+=" $(checks_of force_in_accordance 'bonded_error_percent<=2 sliding_difference_percent<=-10')"
list+=" $(checks_of limit_kept 'nearest_to_limit<=0.999 verdict=holds')"
list+=" $(checks_of slices_interpolate 'ssim>=0.35 psnr_db>=20 verdict=holds')"
list+=" $(checks_of penalty_suits 'contact_steps>=5 restitution>=0 restitution<=1 energy_gain_j<=1e-9')"
list+=" $(checks_of penalty_suits 'impulse_momentum_error<=1e-15 impulse_momentum_error>=-1e-15')"
list+=" $(checks_of penalty_suits 'impulse_energy_error<=1e-12 impulse_energy_error>=-1e-12')"
list+=" $(checks_of contact_linear 'volume_error_percent<=1 work_slope>=0.8 work_slope<=1.15 verdict=holds')"
list+=" $(checks_of explicit_diverges 'farthest_percent<=2 verdict=holds')"
list+=" $(checks_of larger_steps_outweigh 'step_ratio>=2')"
list+=" $(checks_of elements_slower 'two_layer_step_ms>=0 condensed_from_whole<=1e-10 condensed_from_engine<=1e-4')"
list+=" $(checks_of linear_solid_inconvenient 'linear_percent>=5')"
list+=" $(checks_of sparse_storage 'ratio>=100 verdict=holds')"
list+=" $(checks_of inversion_cubic 'difference<=1e-7 crossover_nodes:number')"
list+=" $(checks_of frames_per_second 'steps_per_s:number') $(checks_of real_time 'median_ms:number')"
list+=" $(checks_of collision_expensive 'share_percent>=0 share_percent<=100')"
list+=" $(checks_of distance_linear 'work_slope>=0.9 work_slope<=1.1 verdict=holds')"
for row in linear_springs normal_springs two_layer_paper two_layer_shear; do
  for key in parameters mae_n sd_n linear_percent point_percent both_percent third_percent left_out_percent setup_ms step_ms; do
    list+=" tables.models.rows.$row.$key:number"
  done
done
list+=" tables.models.rows.two_layer_shear.third_percent<=2.6 tables.models.rows.linear_springs.both_percent>=20"
for table in contact volume stability integration solvers distance; do list+=" tables.$table.title:text tables.$table.rows:object"; done
for k in 1 2 3 4 5 6 7 8; do list+=" figures.fig$k.title:text figures.fig$k.caption:text figures.fig$k.bytes>=10000"; done
list+=" figures.fig9.title:text figures.fig9.bytes>=2000 tables.equal_error.caption:text"
list+=" $(checks_of elements_slower_at_equal_error 'two_layer_step_ms:number linear_solid_step_ms:number condensed_step_ms:number')"
for row in two_layer_shear linear condensed; do
  list+=" tables.equal_error.rows.$row.middle_percent<=12 tables.equal_error.rows.$row.equal_nodes:number"
done
list+=" tables.volumetric.rows.condensed.all_percent:number tables.volumetric.rows.condensed.nodes<=2500 tables.volumetric.rows.condensed.step_ms:number"
gives "$list" paper "$MODEL" -o paper --quick --json

[[ ! -s $err ]] || wrong "sonde paper says something in a pipe"
"$CHECK_JSON" kind=paper holds:integer <paper/paper.json || wrong "paper.json is not the object that was printed"
for k in 1 2 3 4 5 6 7 8 9; do
  [[ $(tail -c 7 "paper/fig$k.svg" 2>/dev/null) == "</svg>"* ]] || wrong "fig$k.svg is not whole"
  shapes=$(grep -cE '<(path|circle|image)' "paper/fig$k.svg" || true)
  ((shapes >= 1 + (k > 2) * 20)) || wrong "fig$k.svg holds $shapes shapes"
done
[[ $(wc -c <paper/paper.html) -gt 500000 ]] || wrong "paper.html does not hold the figures"
if [[ -n ${PAPER_REPORT:-} ]]; then # for the browser's test
  mkdir -p "$(dirname "$PAPER_REPORT")"
  cp paper/paper.html "$PAPER_REPORT"
fi
touch "$work/in/file"
rejects 'is missing' paper "$MODEL"
rejects 'expected|directory' paper "$MODEL" -o "$work/in/file"
finish
