// The entry points of one instruction-set variant. A variant file defines HGS_VARIANT and includes this.
#pragma once
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
HGS_INLINE void clear_pairs(const Tile& tile, std::uint32_t first, float* pair_sums) {
  for (std::uint32_t i = first; i < tile.n_entries; ++i) {
    *reinterpret_cast<VFloat8*>(pair_sums + 8 * std::size_t{tile.entries[i].pair}) = VFloat8{};
  }
}

// Sweeps every tile forward, then calls visit(index, tile, window, forward state).
template <class Visit>
HGS_INLINE void for_each_tile_forward(const Workspace& workspace, const PinholeCamera& camera, Visit&& visit) {
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
#pragma omp parallel
  {
    const FlushDenormals flush;
    ForwardTile state;
#pragma omp for schedule(dynamic, 4)
    for (int index = 0; index < n_tiles; ++index) {
      Tile tile = tile_at(workspace, index);
      const int tx = index % workspace.tiles_x, ty = index / workspace.tiles_x;
      const Window window = window_of(camera, tx, ty);
      clear(state, window.width, window.height);
      sweep_forward(tile, workspace.splats.get(), state);
      visit(index, tile, window, state);
    }
  }
}

static void forward(const GaussianRows& gaussians, const PinholeCamera& camera, const ImageSums& image) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare(gaussians, camera, workspace);
  for_each_tile_forward(workspace, camera,
                        [&](int, const Tile&, const Window& window, const ForwardTile& state) {
                          for (int row = 0; row < window.height; ++row) {
                            const std::size_t first = window.first_pixel + std::size_t{1} * row * camera.width;
                            const float(*planes)[TILE_W] = state.rows[row];
                            for (int x = 0; x < window.width; ++x) {
                              image.colour[3 * (first + x)] = planes[R_PLANE][x];
                              image.colour[3 * (first + x) + 1] = planes[G_PLANE][x];
                              image.colour[3 * (first + x) + 2] = planes[B_PLANE][x];
                              image.depth[first + x] = planes[D_PLANE][x];
                              image.silhouette[first + x] = 1.0f - planes[T_PLANE][x];
                            }
                          }
                        });
}

static void backward(const GaussianRows& gaussians, const PinholeCamera& camera, const ImageGradients& image,
                     float* gradient) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare(gaussians, camera, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * 8);
  for_each_tile_forward(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state) {
                          GradientTile gradients;
                          gradients_of_image(state, window, camera, image, gradients);
                          const std::uint32_t done = sweep_backward(tile, workspace.splats.get(), gradients, pair_sums);
                          clear_pairs(tile, done, pair_sums);
                        });
  add_gradients(workspace, camera, gradient);
}

static LossSums optimise(const GaussianRows& gaussians, const PinholeCamera& whole, const Target& target,
                         const AdamState& adam) {
  LossSums loss;
  const ValidDepths valid = valid_depths(target, whole);
  loss.pixels = valid.pixels;
  if (loss.pixels == 0) return loss;
  // Other rooms lie in the frustum too: half the work of a late mission, and nothing to learn about them.
  PinholeCamera camera = whole;
  camera.far_m = valid.farthest + BEHIND_M;
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare(gaussians, camera, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * 8);
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
  double* tile_losses = workspace.tile_losses.require(std::size_t{4} * n_tiles);
  const LossScale scale = loss_scale(target, loss.pixels);
  for_each_tile_forward(workspace, camera,
                        [&](int index, const Tile& tile, const Window& window, const ForwardTile& state) {
                          GradientTile gradients;
                          gradients_of_loss(state, window, camera, target, scale, gradients, tile_losses + 4 * index);
                          const std::uint32_t done = sweep_backward(tile, workspace.splats.get(), gradients, pair_sums);
                          clear_pairs(tile, done, pair_sums);
                        });
  step_visible(workspace, camera, adam);
  double uncovered = 0.0, covered = 0.0;
  for (int index = 0; index < n_tiles; ++index) {
    loss.colour_l1 += tile_losses[4 * index];
    loss.depth_l1_m += tile_losses[4 * index + 1];
    uncovered += tile_losses[4 * index + 2];
    covered += tile_losses[4 * index + 3];
  }
  loss.total = (target.colour_weight * loss.colour_l1 + target.depth_weight * loss.depth_l1_m +
                target.silhouette_weight * uncovered) /
               static_cast<double>(loss.pixels);
  loss.covered = static_cast<std::int64_t>(covered);
  if (loss.covered > 0) {
    loss.colour_l1 /= covered;
    loss.depth_l1_m /= covered;
  }
  return loss;
}

// Evaluations of a forward sweep over one tile.
static double count_evaluations(const Tile& tile, const Splat* splats, ForwardTile& state) {
  constexpr int STRIDE = FORWARD_PLANES * TILE_W;
  double vectors = 0.0;
  sweep(tile, splats, state.rows[0][T_PLANE], STRIDE,
        [&](TileEntry, const Splat&, const Footprint& footprint, RowRange rows) HGS_LAMBDA {
    const int n_rows = rows.last < rows.first ? 0 : rows.last - rows.first + 1;
    const int n_columns = footprint.last_vector - footprint.first_vector + 1;
    vectors += n_rows * n_columns;
    for (int j = footprint.first_vector; j <= footprint.last_vector; ++j) {
      for (int row = rows.first; row <= rows.last; ++row) {
        float* T = state.rows[row][T_PLANE] + j * LANES;
        store(T, load(T) - masked_alpha(footprint.down[row] * footprint.along[j], load(T)) * load(T));
      }
    }
  });
  return vectors * LANES;
}

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
  prepare(gaussians, camera, workspace);
  times.prepare_s = lap();
  for_each_tile_forward(workspace, camera, [](int, const Tile&, const Window&, const ForwardTile&) {});
  times.forward_s = lap();
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * 8);
  const int n_tiles = workspace.tiles_x * workspace.tiles_y;
  double* tile_losses = workspace.tile_losses.require(std::size_t{4} * n_tiles);
  const LossScale scale = loss_scale(target, valid_depths(target, camera).pixels + 1);
  began = omp_get_wtime();
  for_each_tile_forward(workspace, camera,
                        [&](int index, const Tile& tile, const Window& window, const ForwardTile& state) {
                          GradientTile gradients;
                          gradients_of_loss(state, window, camera, target, scale, gradients, tile_losses + 4 * index);
                          const std::uint32_t done = sweep_backward(tile, workspace.splats.get(), gradients, pair_sums);
                          clear_pairs(tile, done, pair_sums);
                        });
  times.backward_s = lap() - times.forward_s;
  step_visible(workspace, camera, adam);
  times.step_s = lap();
  ForwardTile state;
  for (int index = 0; index < n_tiles; ++index) {
    const Window window = window_of(camera, index % workspace.tiles_x, index / workspace.tiles_x);
    clear(state, window.width, window.height);
    times.evaluations += count_evaluations(tile_at(workspace, index), workspace.splats.get(), state);
  }
  return times;
}

static void information(const GaussianRows& gaussians, const PinholeCamera& camera, float* information) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare(gaussians, camera, workspace);
  float* pair_sums = workspace.pair_sums.require(workspace.n_pairs * 8);
  for_each_tile_forward(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state) {
                          FisherTile fisher;
                          start_fisher(state, window, fisher);
                          clear_pairs(tile, sweep_fisher(tile, workspace.splats.get(), fisher, pair_sums), pair_sums);
                        });
  add_information(workspace, camera, information);
}

static void quality_image(const GaussianRows& gaussians, const PinholeCamera& camera, const float* information,
                          float prior, float* image) {
  const WorkspaceLease lease;
  Workspace& workspace = *lease;
  prepare(gaussians, camera, workspace);
  quality_coefficients(workspace, camera, information, prior);
  const float* coefficients = workspace.slot_coefficients.get();
  for_each_tile_forward(workspace, camera,
                        [&](int, const Tile& tile, const Window& window, const ForwardTile& state) {
                          FisherTile fisher;
                          start_fisher(state, window, fisher);
                          sweep_quality(tile, workspace.splats.get(), fisher, coefficients);
                          for (int row = 0; row < window.height; ++row) {
                            float* out = image + window.first_pixel + std::size_t{1} * row * camera.width;
                            for (int x = 0; x < window.width; ++x) out[x] = fisher.rows[row][GAIN_PLANE][x];
                          }
                        });
}

}  // namespace hgs::HGS_VARIANT
