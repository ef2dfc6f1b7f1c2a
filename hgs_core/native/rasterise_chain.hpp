// From sums over pixels to parameters, Gaussian by Gaussian.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_disc_slopes.hpp"

namespace hgs::HGS_VARIANT {

// The splat's sums over all its tiles.
template <class Shape>
HGS_INLINE PairSums<Shape> gather(const float* pair_sums, std::uint32_t begin, std::uint32_t end) {
  PairSums<Shape> total = {};
  for (std::uint32_t pair = begin; pair < end; ++pair) {
    for (int part = 0; part < Shape::SUMS / 8; ++part) {
      total.parts[part] += load8(pair_sums + Shape::SUMS * std::size_t{pair} + 8 * part);
    }
  }
  return total;
}

HGS_INLINE std::uint32_t end_of_pairs(const Workspace& workspace, std::size_t block, std::uint32_t rank) {
  const bool last = rank + 1 == workspace.block_splats.get()[block];
  return last ? workspace.pairs_before.get()[block + 1] : workspace.spans.get()[block * BLOCK + rank + 1].first_pair;
}

// Calls visit(splat, sums, state of its block) for every splat, in map order; a block is visited by one thread.
template <class Shape, class BeginBlock, class Visit, class EndBlock>
HGS_INLINE void for_each_splat(const Workspace& workspace, BeginBlock&& begin_block, Visit&& visit,
                               EndBlock&& end_block) {
  const typename Shape::Splat* splats = workspace.of<Shape>().splats.get();
  const TileSpan* spans = workspace.spans.get();
  const float* pair_sums = workspace.pair_sums.get();
#pragma omp parallel
  {
    const FlushDenormals flush;
#pragma omp for schedule(dynamic, 8)
    for (std::size_t block = 0; block < workspace.n_visible_blocks; ++block) {
      auto state = begin_block(block);
      for (std::uint32_t rank = 0; rank < workspace.block_splats.get()[block]; ++rank) {
        const std::size_t slot = block * BLOCK + rank;
        const std::uint32_t end = end_of_pairs(workspace, block, rank);
        visit(splats[slot], gather<Shape>(pair_sums, spans[slot].first_pair, end), state);
      }
      end_block(block, state);
    }
  }
}

struct Nothing {};

template <class Shape>
HGS_INLINE bool all_zero(const PairSums<Shape>& sums) {
  for (const VFloat8& part : sums.parts) {
    if (!all_zero8(part)) return false;
  }
  return true;
}

// Calls add(splat, sums, state of its block) for the discs that any pixel shows, and finish(state) for every LANES of
// them and at the end of a block.
template <class BeginBlock, class Finish, class EndBlock>
HGS_INLINE void for_each_disc_batch(const GaussianRows& gaussians, const Workspace& workspace,
                                    BeginBlock&& begin_block, Finish&& finish, EndBlock&& end_block) {
  struct State {
    decltype(begin_block(std::size_t{})) of_block;
    DiscBatch batch;
  };
  for_each_splat<Disc>(
      workspace, [&](std::size_t block) HGS_LAMBDA { return State{begin_block(block), {}}; },
      [&](const DiscSplat& splat, const PairSums<Disc>& sums, State& state) HGS_LAMBDA {
        if (all_zero(sums)) return;
        state.batch.add(splat, gaussians, sums);
        if (state.batch.full()) finish(state.batch, state.of_block);
      },
      [&](std::size_t block, State& state) HGS_LAMBDA {
        if (!state.batch.empty()) finish(state.batch, state.of_block);
        end_block(block, state.of_block);
      });
}

// Calls visit(row, gradient, state of its block) for every splat that any pixel shows.
template <class Shape, class BeginBlock, class Visit, class EndBlock>
HGS_INLINE void for_each_gradient(const GaussianRows& gaussians, const Workspace& workspace,
                                  const PinholeCamera& camera, BeginBlock&& begin_block, Visit&& visit,
                                  EndBlock&& end_block) {
  if constexpr (std::is_same_v<Shape, Isotropic>) {
    const View view(camera);
    for_each_splat<Isotropic>(
        workspace, begin_block,
        [&](const RoundSplat& splat, const PairSums<Isotropic>& sums, auto& state) HGS_LAMBDA {
          if (!all_zero(sums)) visit(splat.row, RoundSlopes(splat, view).gradient(sums), state);
        },
        end_block);
  } else {
    for_each_disc_batch(
        gaussians, workspace, begin_block,
        [&](DiscBatch& batch, auto& state) HGS_LAMBDA {
          batch.finish_gradients(camera, [&](std::uint32_t row, const RowGradient<Disc>& gradient) HGS_LAMBDA {
            visit(row, gradient, state);
          });
        },
        end_block);
  }
}

// `normal_gradients`: of discs.
template <class Shape>
static void add_gradients(const GaussianRows& gaussians, const Workspace& workspace, const PinholeCamera& camera,
                          float* gradients, float* normal_gradients) {
  for_each_gradient<Shape>(
      gaussians, workspace, camera, [](std::size_t) { return Nothing{}; },
      [&](std::uint32_t row, const RowGradient<Shape>& gradient, Nothing&) HGS_LAMBDA {
        float* out = gradients + N_PARAMETERS * std::size_t{row};
        store8(out, load8(out) + gradient.parameters);
        if constexpr (std::is_same_v<Shape, Disc>) {
          for (int k = 0; k < N_NORMAL; ++k) normal_gradients[N_NORMAL * std::size_t{row} + k] += gradient.normal[k];
        }
      },
      [](std::size_t, Nothing&) {});
}

// `weight` of a pixel: what it stands for.
template <class Shape>
static void add_information(const GaussianRows& gaussians, const Workspace& workspace, const PinholeCamera& camera,
                            float weight, float* information) {
  const auto nothing = [](std::size_t) { return Nothing{}; };
  const auto no_end = [](std::size_t, Nothing&) {};
  if constexpr (std::is_same_v<Shape, Isotropic>) {
    const View view(camera);
    for_each_splat<Isotropic>(
        workspace, nothing,
        [&](const RoundSplat& splat, const PairSums<Isotropic>& sums, Nothing&) HGS_LAMBDA {
          if (all_zero(sums)) return;
          float* H = information + N_PARAMETERS * std::size_t{splat.row};
          RoundSlopes(splat, view).add_information({{weight * sums.parts[0]}}, H);
        },
        no_end);
  } else {
    for_each_disc_batch(
        gaussians, workspace, nothing,
        [&](DiscBatch& batch, Nothing&) HGS_LAMBDA { batch.finish_information(camera, weight, information); }, no_end);
  }
}

static void form_of(const RoundSplat& splat, const GaussianRows&, const View& view, const float* share, float* c) {
  RoundSlopes(splat, view).form(share, c);
}

static void form_of(const DiscSplat& splat, const GaussianRows& rows, const View& view, const float* share, float* c) {
  const SeenDisc<float> seen = seen_disc(splat, rows);
  DiscSlopes<float>(seen, view.camera, widest_tangents(view.camera)).form(share, c);
}

// Per slot, the form whose value at a pixel is sum_k (dC/dw_k)^2 / (H_k + prior_k): see sweep_quality.
template <class Shape>
static void quality_coefficients(const GaussianRows& gaussians, Workspace& workspace, const PinholeCamera& camera,
                                 const float* information, const float* prior) {
  float* coefficients = workspace.slot_coefficients.require(workspace.n_visible_blocks * BLOCK * Shape::SUMS);
  const typename Shape::Splat* splats = workspace.of<Shape>().splats.get();
  const View view(camera);
#pragma omp parallel for schedule(dynamic, 8)
  for (std::size_t block = 0; block < workspace.n_visible_blocks; ++block) {
    for (std::uint32_t rank = 0; rank < workspace.block_splats.get()[block]; ++rank) {
      const std::size_t slot = block * BLOCK + rank;
      const float* H = information + N_PARAMETERS * std::size_t{splats[slot].row};
      float share[N_PARAMETERS];
      for (int k = 0; k < N_PARAMETERS; ++k) share[k] = 1.0f / (H[k] + prior[k]);
      float* c = coefficients + Shape::SUMS * slot;
      for (int k = 0; k < Shape::SUMS; ++k) c[k] = 0.0f;
      form_of(splats[slot], gaussians, view, share, c);
    }
  }
}

}  // namespace hgs::HGS_VARIANT
