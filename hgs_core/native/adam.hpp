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

// 1 / (1 - beta^step) of both moments.
struct BiasCorrection {
  float first, second;
};

HGS_INLINE BiasCorrection bias_correction(const AdamState& adam, const float* table, std::int32_t step) {
  if (step < TABLED_STEPS) return {table[2 * step], table[2 * step + 1]};
  return {static_cast<float>(1.0 / (1.0 - __builtin_pow(adam.beta1, step))),
          static_cast<float>(1.0 / (1.0 - __builtin_pow(adam.beta2, step)))};
}

HGS_INLINE void adam_row(const AdamState& adam, const BiasCorrection& correct, std::uint32_t row, VFloat8 gradient) {
  const std::size_t first = N_PARAMETERS * std::size_t{row};
  const VFloat8 m = adam.beta1 * load8(adam.first_moment + first) + (1.0f - adam.beta1) * gradient;
  const VFloat8 v = adam.beta2 * load8(adam.second_moment + first) + (1.0f - adam.beta2) * gradient * gradient;
  store8(adam.first_moment + first, m);
  store8(adam.second_moment + first, v);
  float* p = adam.parameters + first;
  store8(p, load8(p) - load8(adam.rates) * (m * correct.first) / (vsqrt8(v * correct.second) + adam.epsilon));
  const float log_radius = p[6] < adam.min_log_radius ? adam.min_log_radius : p[6];
  p[6] = log_radius > adam.max_log_radius ? adam.max_log_radius : log_radius;
}

// The step, and back to a unit vector.
HGS_INLINE void adam_normal(const AdamState& adam, const BiasCorrection& correct, std::uint32_t row, VFloat8 gradient) {
  const std::size_t first = N_NORMAL * std::size_t{row};
  const auto of = [&](const float* rows) HGS_LAMBDA {
    return VFloat8{rows[first], rows[first + 1], rows[first + 2]};
  };
  const VFloat8 m = adam.beta1 * of(adam.normal_first_moment) + (1.0f - adam.beta1) * gradient;
  const VFloat8 v = adam.beta2 * of(adam.normal_second_moment) + (1.0f - adam.beta2) * gradient * gradient;
  const VFloat8 step = adam.normal_rate * (m * correct.first) / (vsqrt8(v * correct.second) + adam.epsilon);
  const VFloat8 turned = of(adam.normals) - step;
  const float length2 = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2];
  const VFloat8 unit = turned * (1.0f / __builtin_sqrtf(length2));
  for (int k = 0; k < N_NORMAL; ++k) {
    adam.normal_first_moment[first + k] = m[k];
    adam.normal_second_moment[first + k] = v[k];
    adam.normals[first + k] = unit[k];
  }
}

template <class Shape>
static void step_visible(const GaussianRows& gaussians, Workspace& workspace, const PinholeCamera& camera,
                         const AdamState& adam) {
  const float* table = bias_corrections(adam, workspace);
  for_each_gradient<Shape>(
      gaussians, workspace, camera,
      [](std::size_t) {
        StepBlock moved;
        moved.n_moved = 0;
        return moved;
      },
      [&](std::uint32_t row, const RowGradient<Shape>& gradient, StepBlock& moved) HGS_LAMBDA {
        if (all_zero8(gradient.parameters)) return;
        const BiasCorrection correct = bias_correction(adam, table, ++adam.steps[row]);
        adam_row(adam, correct, row, gradient.parameters);
        if constexpr (std::is_same_v<Shape, Disc>) adam_normal(adam, correct, row, gradient.normal);
        moved.rows[moved.n_moved] = row;
        moved.log_radii[moved.n_moved++] = adam.parameters[N_PARAMETERS * std::size_t{row} + 6];
      },
      [&](std::size_t, StepBlock& moved) { widen_bounds(adam, moved); });
}

}  // namespace hgs::HGS_VARIANT
