// Adam (Kingma and Ba 2015) on the Gaussians that got a gradient, each with a step count of its own.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_chain.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr std::int32_t TABLED_STEPS = 1024;

// 1 / (1 - beta^step) of both moments, for steps 0 .. TABLED_STEPS - 1.
static const float* bias_corrections(const AdamState& adam, Workspace& workspace) {
  float* table = workspace.bias_corrections.require(2 * TABLED_STEPS);
  double power1 = 1.0, power2 = 1.0;
  table[0] = table[1] = 1.0f;  // never used: a step is counted before it is taken
  for (std::int32_t step = 1; step < TABLED_STEPS; ++step) {
    power1 *= adam.beta1;
    power2 *= adam.beta2;
    table[2 * step] = static_cast<float>(1.0 / (1.0 - power1));
    table[2 * step + 1] = static_cast<float>(1.0 / (1.0 - power2));
  }
  return table;
}

struct StepBlock {
  int n_moved;
  std::uint32_t rows[BLOCK];
  alignas(64) float log_radii[BLOCK];
};

// Widens the block's bounds to centre -+ radius of the rows that moved: culling stays right between refreshes.
HGS_INLINE void widen_bounds(const AdamState& adam, StepBlock& moved) {
  if (moved.n_moved == 0) return;
  float* bounds = adam.block_bounds + 6 * std::size_t{moved.rows[0] / BLOCK};
  for (int i = moved.n_moved; i % LANES != 0; ++i) moved.log_radii[i] = 0.0f;
  for (int i = 0; i < moved.n_moved; i += LANES) store(moved.log_radii + i, vexp(load(moved.log_radii + i)));
  VFloat8 lower = {bounds[0], bounds[1], bounds[2]}, upper = {bounds[3], bounds[4], bounds[5]};  // lanes 3 .. unused
  for (int i = 0; i < moved.n_moved; ++i) {
    const VFloat8 centre = load8(adam.parameters + N_PARAMETERS * std::size_t{moved.rows[i]});
    const float radius = moved.log_radii[i] * 1.00001f;
    lower = vmin8(centre - radius, lower);
    upper = vmax8(centre + radius, upper);
  }
  for (int j = 0; j < 3; ++j) {
    bounds[j] = lower[j];
    bounds[3 + j] = upper[j];
  }
}

HGS_INLINE void adam_row(const AdamState& adam, const float* table, std::uint32_t row, VFloat8 gradient) {
  const std::size_t first = N_PARAMETERS * std::size_t{row};
  const std::int32_t step = ++adam.steps[row];
  float correct1, correct2;
  if (step < TABLED_STEPS) {
    correct1 = table[2 * step];
    correct2 = table[2 * step + 1];
  } else {
    correct1 = static_cast<float>(1.0 / (1.0 - __builtin_pow(adam.beta1, step)));
    correct2 = static_cast<float>(1.0 / (1.0 - __builtin_pow(adam.beta2, step)));
  }
  const VFloat8 m = adam.beta1 * load8(adam.first_moment + first) + (1.0f - adam.beta1) * gradient;
  const VFloat8 v = adam.beta2 * load8(adam.second_moment + first) + (1.0f - adam.beta2) * gradient * gradient;
  store8(adam.first_moment + first, m);
  store8(adam.second_moment + first, v);
  float* p = adam.parameters + first;
  store8(p, load8(p) - load8(adam.rates) * (m * correct1) / (vsqrt8(v * correct2) + adam.epsilon));
  const float log_radius = p[6] < adam.min_log_radius ? adam.min_log_radius : p[6];
  p[6] = log_radius > adam.max_log_radius ? adam.max_log_radius : log_radius;
}

static void step_visible(Workspace& workspace, const PinholeCamera& camera, const AdamState& adam) {
  const float* table = bias_corrections(adam, workspace);
  const CameraAxes axes = camera_axes(camera);
  for_each_splat(
      workspace,
      [](std::size_t) {
        StepBlock moved;
        moved.n_moved = 0;
        return moved;
      },
      [&](const Splat& splat, VFloat8 sums, StepBlock& moved) HGS_LAMBDA {
        const VFloat8 gradient = chain_gradient(splat, camera, axes, sums);
        if (all_zero8(gradient)) return;
        adam_row(adam, table, splat.row, gradient);
        moved.rows[moved.n_moved] = splat.row;
        moved.log_radii[moved.n_moved++] = adam.parameters[N_PARAMETERS * std::size_t{splat.row} + 6];
      },
      [&](std::size_t, StepBlock& moved) { widen_bounds(adam, moved); });
}

}  // namespace hgs::HGS_VARIANT
