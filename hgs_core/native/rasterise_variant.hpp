// The entry points of one instruction-set variant. A variant file defines HGS_VARIANT and includes this.
#pragma once
#include <algorithm>

#include <omp.h>

#include "adam.hpp"
#include "rasterise_loss.hpp"
#include "rasterise_project.hpp"

namespace hgs::HGS_VARIANT {

HGS_INLINE Tile tile_at(const Workspace& workspace, int index) {
  const std::uint32_t* begin = workspace.tile_begin.get();
  const int tx = index % workspace.tiles_x, ty = index / workspace.tiles_x;
  return {tx * TILE_W + 0.5f, ty * TILE_H + 0.5f, workspace.entries.get() + begin[index],
          begin[index + 1] - begin[index]};
}

// Splats behind the point where a tile went opaque got nothing.
template <class Shape>
HGS_INLINE void clear_pairs(const Tile& tile, std::uint32_t first, float* pair_sums) {
  for (std::uint32_t i = first; i < tile.n_entries; ++i) {
    float* sums = pair_sums + Shape::SUMS * std::size_t{tile.entries[i].pair};
    for (int k = 0; k < Shape::SUMS; k += 8) store8(sums + k, VFloat8{});
  }
}

// Sweeps every tile forward, then calls visit(index, tile, window, state, traces).
template <class Shape, class Visit>
HGS_INLINE void for_each_tile_forward(Workspace& workspace, const PinholeCamera& camera, Visit&& visit) {
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
  const std::size_t n_traces = std::size_t{workspace.most_entries} * omp_get_max_threads();
  typename Shape::Trace* traces = workspace.of<Shape>().traces.require(n_traces);
#pragma omp parallel
  {
    const FlushDenormals flush;
    typename Shape::Trace* mine = traces + std::size_t{workspace.most_entries} * omp_get_thread_num();
    ForwardTile state;
#pragma omp for schedule(dynamic, 4)
    for (int index = 0; index < n_tiles; ++index) {
      const Tile tile = tile_at(workspace, index);
      const Window window = window_of(camera, index % workspace.tiles_x, index / workspace.tiles_x);
      __builtin_memset(&state, 0, sizeof(state));
      fill_transmittance(state, window.width, window.height);
      visit(index, tile, window, state, sweep_forward<Shape>(tile, workspace.of<Shape>().splats.get(), state, mine));
    }
  }
}

template <class Shape>
static void forward(const GaussianRows& gaussians, const PinholeCamera& camera, const float* surface,
                    const ImageSums& image) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare_before<Shape>(gaussians, camera, surface, workspace);
  for_each_tile_forward<Shape>(workspace, camera,
                        [&](int, const Tile&, const Window& window, const ForwardTile& state, Traces<Shape>) {
                          for (int y = 0; y < window.height; ++y) {
                            const std::size_t first = window.first_pixel + std::size_t{1} * y * camera.width;
                            for (int x = 0; x < window.width; ++x) {
                              const PixelPlace at = place_of(x, y);
                              const float(*planes)[PATCH] = state.patches[at.patch];
                              for (int k = 0; k < 3; ++k) {
                                image.colour[3 * (first + x) + k] = planes[R_PLANE + k][at.lane];
                              }
                              image.depth[first + x] = planes[D_PLANE][at.lane];
                              image.silhouette[first + x] = 1.0f - planes[T_PLANE][at.lane];
                            }
                          }
                        });
}

template <class Shape>
static void backward(const GaussianRows& gaussians, const PinholeCamera& camera, const ImageGradients& image,
                     float* gradient, [[maybe_unused]] float* normal_gradient) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare<Shape>(gaussians, camera, nullptr, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * Shape::SUMS);
  for_each_tile_forward<Shape>(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state, Traces<Shape> traces) {
                          GradientTile gradients;
                          gradients_of_image(state, window, camera, image, gradients);
                          sweep_backward<Shape>(tile, traces, gradients, pair_sums);
                          clear_pairs<Shape>(tile, traces.n, pair_sums);
                        });
  add_gradients<Shape>(gaussians, workspace, camera, gradient, normal_gradient);
}

// Both sweeps of every tile, with the loss between them. `second_half_s`, unless null: per thread, the time spent on the
// loss and the backward sweep is added to it.
template <class Shape>
static void sweep_loss(Workspace& workspace, const PinholeCamera& camera, const Target& target, const LossScale& scale,
                       float* pair_sums, double* tile_losses, double* second_half_s) {
  for_each_tile_forward<Shape>(
      workspace, camera,
      [&](int index, const Tile& tile, const Window& window, const ForwardTile& state, Traces<Shape> traces) {
        const double began = second_half_s == nullptr ? 0.0 : omp_get_wtime();
        GradientTile gradients;
        gradients_of_loss(state, window, camera, target, scale, gradients, tile_losses + LOSS_SUMS * index);
        sweep_backward<Shape>(tile, traces, gradients, pair_sums);
        clear_pairs<Shape>(tile, traces.n, pair_sums);
        if (second_half_s != nullptr) second_half_s[omp_get_thread_num()] += omp_get_wtime() - began;
      });
}

template <class Shape>
static LossSums optimise(const GaussianRows& gaussians, const PinholeCamera& whole, const Target& target,
                         const AdamState& adam) {
  LossSums loss;
  const ValidDepths valid = valid_depths(target, whole);
  loss.pixels = valid.pixels;
  if (loss.pixels == 0) return loss;
  // Other rooms lie in the frustum too: half the work of a late mission, and nothing to learn about them.
  PinholeCamera camera = whole;
  camera.far_m = std::min(whole.far_m, valid.farthest + BEHIND_M);
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare_before<Shape>(gaussians, camera, target.depth, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * Shape::SUMS);
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
  double* tile_losses = workspace.tile_losses.require(std::size_t{LOSS_SUMS} * n_tiles);
  const LossScale scale = loss_scale(target, loss.pixels);
  sweep_loss<Shape>(workspace, camera, target, scale, pair_sums, tile_losses, nullptr);
  step_visible<Shape>(gaussians, workspace, camera, adam);
  double uncovered = 0.0, covered = 0.0, in_the_way = 0.0;
  for (int index = 0; index < n_tiles; ++index) {
    loss.colour_l1 += tile_losses[LOSS_SUMS * index];
    loss.depth_l1_m += tile_losses[LOSS_SUMS * index + 1];
    uncovered += tile_losses[LOSS_SUMS * index + 2];
    covered += tile_losses[LOSS_SUMS * index + 3];
    in_the_way += tile_losses[LOSS_SUMS * index + 4];
  }
  loss.total = (target.colour_weight * loss.colour_l1 + target.depth_weight * loss.depth_l1_m +
                target.silhouette_weight * uncovered + target.free_weight * in_the_way) /
               static_cast<double>(loss.pixels);
  loss.covered = static_cast<std::int64_t>(covered);
  if (loss.covered > 0) {
    loss.colour_l1 /= covered;
    loss.depth_l1_m /= covered;
  }
  return loss;
}

template <class Shape>
static StageTimes stages(const GaussianRows& gaussians, const PinholeCamera& camera, const Target& target,
                         const AdamState& adam) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  StageTimes times;
  double began = omp_get_wtime();
  const auto lap = [&] {
    const double now = omp_get_wtime(), spent = now - began;
    began = now;
    return spent;
  };
  prepare_before<Shape>(gaussians, camera, target.depth, workspace);
  times.prepare_s = lap();
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * Shape::SUMS);
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
  double* tile_losses = workspace.tile_losses.require(std::size_t{LOSS_SUMS} * n_tiles);
  const LossScale scale = loss_scale(target, valid_depths(target, camera).pixels + 1);
  const int threads = omp_get_max_threads();
  double* second_half_s = workspace.thread_times.require(std::size_t{1} * threads);
  for (int t = 0; t < threads; ++t) second_half_s[t] = 0.0;
  began = omp_get_wtime();
  sweep_loss<Shape>(workspace, camera, target, scale, pair_sums, tile_losses, second_half_s);
  for (int t = 0; t < threads; ++t) times.backward_s += second_half_s[t] / threads;
  times.forward_s = lap() - times.backward_s;
  step_visible<Shape>(gaussians, workspace, camera, adam);
  times.step_s = lap();
  for_each_tile_forward<Shape>(workspace, camera,
                        [&](int index, const Tile&, const Window&, const ForwardTile&, Traces<Shape> traces) {
                          std::uint64_t patches = 0;
                          for (std::uint32_t i = 0; i < traces.n; ++i) {
                            patches += __builtin_popcount(traces.first[i].patches);
                          }
                          tile_losses[index] = static_cast<double>(patches * PATCH);
                        });
  for (int index = 0; index < n_tiles; ++index) times.evaluations += tile_losses[index];
  return times;
}

template <class Shape>
static void information(const GaussianRows& gaussians, const PinholeCamera& camera, const float* surface, float weight,
                        float* information) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare_before<Shape>(gaussians, camera, surface, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * Shape::SUMS);
  for_each_tile_forward<Shape>(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state, Traces<Shape> traces) {
                          FisherTile fisher;
                          start_fisher(state, window, fisher);
                          sweep_fisher<Shape>(tile, traces, fisher, pair_sums);
                          clear_pairs<Shape>(tile, traces.n, pair_sums);
                        });
  add_information<Shape>(gaussians, workspace, camera, weight, information);
}

template <class Shape>
static void quality_image(const GaussianRows& gaussians, const PinholeCamera& camera, const float* information,
                          const float* prior, float* image) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare<Shape>(gaussians, camera, nullptr, workspace);
  quality_coefficients<Shape>(gaussians, workspace, camera, information, prior);
  const float* coefficients = workspace.slot_coefficients.get();
  for_each_tile_forward<Shape>(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state, Traces<Shape> traces) {
                          FisherTile fisher;
                          start_fisher(state, window, fisher);
                          sweep_quality<Shape>(tile, traces, fisher, coefficients);
                          for (int y = 0; y < window.height; ++y) {
                            float* out = image + window.first_pixel + std::size_t{1} * y * camera.width;
                            for (int x = 0; x < window.width; ++x) {
                              const PixelPlace at = place_of(x, y);
                              out[x] = fisher.patches[at.patch][GAIN_PLANE][at.lane];
                            }
                          }
                        });
}

template <class Shape>
constexpr RasteriseKernels rasterise_kernels_of() {
  return {forward<Shape>, backward<Shape>, stages<Shape>, optimise<Shape>, information<Shape>, quality_image<Shape>};
}

}  // namespace hgs::HGS_VARIANT
