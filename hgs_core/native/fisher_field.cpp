// The exact score of Eq. 9 along a sample of the rays of 360-degree panoramas.
//
//   score of a view = sum over its pixels of  sum_ik (dC/dw_ik)^2 / (I_ik + prior_k)
//
// (the sums over pixels in H_cand and over Gaussians may be exchanged). A sampled ray stands for the pixels around it:
// it is drawn as the middle column of a level camera that looks along its azimuth, with every splat at that camera's
// resolution, so nothing is lost to a coarse image; what a sample misses is a matter of chance, not of size.
//
// A ray walks through cells. Gaussians are sorted by cell, and within it by which of its 4 x 4 x 4 parts they lie in;
// each sixteen in a row are a bundle. A cell lists the bundles that reach into it, so a ray tests bundles sixteen at a
// time and the Gaussians of the few that it comes near to.
//
// Sorting is a counting sort in map order: each thread takes a run of blocks and knows where its rows of each cell
// begin, so that the order does not depend on the number of threads.
#include "fisher_field.hpp"

#include <omp.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "variants.hpp"
#include "whole_number.hpp"

namespace hgs {

namespace {

constexpr int PARTS = 64;  // of a cell

struct Share {
  std::int64_t begin, end;
};

Share share_of(std::int64_t n, int thread, int threads) { return {n * thread / threads, n * (thread + 1) / threads}; }

std::uint32_t bundles_for(std::uint32_t n) { return (n + BUNDLE - 1) / BUNDLE; }

}  // namespace

FisherField::FisherField(const Grid& voxels, const GridPlace& place, const FisherRule& rule)
    : place_(place), rule_(rule) {
  std::size_t n_cells = 1;
  for (int a = 0; a < 3; ++a) {
    grid_.shape[a] = static_cast<std::int32_t>((voxels.shape[a] + CELL_VOXELS - 1) / CELL_VOXELS);
    grid_.lower[a] = static_cast<float>(place.lower[a]);
    n_cells *= static_cast<std::size_t>(grid_.shape[a]);
  }
  grid_.size = static_cast<float>(CELL_VOXELS * place.cell);
  begin_.resize(n_cells);
  end_.resize(n_cells);
  is_wanted_.resize(n_cells);
  first_.resize(n_cells);
}

void FisherField::clear() {
  for (const std::size_t cell : listed_) begin_[cell] = end_[cell] = 0;
  listed_.clear();
  bundles_.clear();
  normals_.clear();
  bounds_.clear();
  reached_.clear();
}

template <class Visit>
void FisherField::for_each_cell(std::size_t chunk, Visit&& visit) const {
  const auto chunks_y = static_cast<std::size_t>(chunks(1));
  const std::size_t nx = grid_.shape[0], ny = grid_.shape[1], nz = grid_.shape[2];
  const std::size_t i0 = chunk / chunks_y * CHUNK_CELLS, j0 = chunk % chunks_y * CHUNK_CELLS;
  for (std::size_t i = i0; i < std::min(i0 + CHUNK_CELLS, nx); ++i) {
    for (std::size_t cell = (i * ny + j0) * nz; cell < (i * ny + std::min(j0 + CHUNK_CELLS, ny)) * nz; ++cell) {
      visit(cell);
    }
  }
}

FisherField::Reached FisherField::reached_by(const BundleBounds& bounds) const {
  Reached cells;
  const float per_cell = 1.0f / grid_.size;
  for (int a = 0; a < 3; ++a) {
    const float low = (bounds.low[a] - grid_.lower[a]) * per_cell, high = (bounds.high[a] - grid_.lower[a]) * per_cell;
    cells.low[a] = floor_within(low, 0, grid_.shape[a]);
    cells.high[a] = floor_within(high, 0, grid_.shape[a] - 1);
  }
  return cells;
}

template <class Visit>
void FisherField::for_each_cell_reached(const Reached& cells, Visit&& visit) const {
  for (std::int32_t i = cells.low[0]; i <= cells.high[0]; ++i) {
    for (std::int32_t j = cells.low[1]; j <= cells.high[1]; ++j) {
      const std::size_t column = (static_cast<std::size_t>(i) * grid_.shape[1] + j) * grid_.shape[2];
      for (std::int32_t k = cells.low[2]; k <= cells.high[2]; ++k) visit(column + k);
    }
  }
}

// Fills `filled_` and `order_`.
void FisherField::sort_rows(const GaussianRows& map, const std::uint8_t* wanted) {
  const auto n_blocks = static_cast<std::int64_t>(first_rows_.size());
  const std::size_t n_cells = begin_.size();
  const int threads = omp_get_max_threads();
  keys_.resize(std::max(keys_.size(), first_rows_.size() * BLOCK));
  counts_.resize(std::max(counts_.size(), n_cells * threads));
  std::vector<std::size_t> wanted_cells;
  for (std::size_t chunk = 0; chunk < static_cast<std::size_t>(chunks(0) * chunks(1)); ++chunk) {
    if (wanted[chunk] != 0) for_each_cell(chunk, [&](std::size_t cell) { wanted_cells.push_back(cell); });
  }
  for (const std::size_t cell : wanted_cells) {
    is_wanted_[cell] = 1;
    for (int t = 0; t < threads; ++t) counts_[n_cells * t + cell] = 0;
  }
#pragma omp parallel num_threads(threads)
  {
    const Share mine = share_of(n_blocks, omp_get_thread_num(), threads);
    std::uint32_t* counts = counts_.data() + n_cells * omp_get_thread_num();
    for (std::int64_t b = mine.begin; b < mine.end; ++b) {
      const auto n = static_cast<std::int32_t>(std::min<std::int64_t>(BLOCK, static_cast<std::int64_t>(map.n) - first_rows_[b]));
      std::uint32_t* keys = keys_.data() + BLOCK * b;
      variant_kernels().gain.list_cells(map.parameters + N_PARAMETERS * first_rows_[b], n, grid_, keys);
      for (std::int32_t i = 0; i < n; ++i) {
        if (keys[i] == NO_CELL) continue;
        if (is_wanted_[keys[i] / PARTS] == 0) {
          keys[i] = NO_CELL;
        } else {
          ++counts[keys[i] / PARTS];
        }
      }
      for (std::int32_t i = n; i < BLOCK; ++i) keys[i] = NO_CELL;
    }
  }
  std::uint32_t n_rows = 0;
  filled_.clear();
  for (const std::size_t cell : wanted_cells) {
    is_wanted_[cell] = 0;
    const std::uint32_t first = n_rows;
    for (int t = 0; t < threads; ++t) {
      std::uint32_t& count = counts_[n_cells * t + cell];
      const std::uint32_t own = count;
      count = n_rows;
      n_rows += own;
    }
    if (n_rows != first) filled_.push_back({first, n_rows - first});
  }
  order_.resize(std::max<std::size_t>(order_.size(), n_rows));
#pragma omp parallel num_threads(threads)
  {
    const Share mine = share_of(n_blocks, omp_get_thread_num(), threads);
    std::uint32_t* next = counts_.data() + n_cells * omp_get_thread_num();
    for (std::int64_t b = mine.begin; b < mine.end; ++b) {
      const std::uint32_t* keys = keys_.data() + BLOCK * b;
      for (std::int32_t i = 0; i < BLOCK; ++i) {
        if (keys[i] == NO_CELL) continue;
        order_[next[keys[i] / PARTS]++] = {keys[i] % PARTS, static_cast<std::uint32_t>(first_rows_[b] + i)};
      }
    }
  }
}

void FisherField::make_bundles(const GaussianRows& map) {
  std::vector<std::uint32_t> first_bundle;
  auto n_bundles = static_cast<std::uint32_t>(bundles_.size());
  for (const FilledCell& cell : filled_) {
    first_bundle.push_back(n_bundles);
    n_bundles += bundles_for(cell.n);
  }
  bundles_.resize(n_bundles);
  if (map.normals != nullptr) normals_.resize(n_bundles);
  bounds_.resize(n_bundles);
  reached_.resize(n_bundles);
  const auto n_filled = static_cast<std::int64_t>(filled_.size());
#pragma omp parallel
  {
    std::vector<std::uint32_t> rows;
#pragma omp for schedule(dynamic, 16)
    for (std::int64_t c = 0; c < n_filled; ++c) {
      const FilledCell& cell = filled_[c];
      const Place* places = order_.data() + cell.first;
      std::array<std::uint32_t, PARTS + 1> begin{};
      for (std::uint32_t i = 0; i < cell.n; ++i) ++begin[places[i].part + 1];
      for (int part = 0; part < PARTS; ++part) begin[part + 1] += begin[part];
      rows.resize(std::max<std::size_t>(rows.size(), cell.n));
      for (std::uint32_t i = 0; i < cell.n; ++i) rows[begin[places[i].part]++] = places[i].row;
      for (std::uint32_t i = 0, bundle = first_bundle[c]; i < cell.n; i += BUNDLE, ++bundle) {
        const auto n = static_cast<std::int32_t>(std::min<std::uint32_t>(BUNDLE, cell.n - i));
        variant_kernels().gain.make_bundle(map.parameters, map.normals, rows.data() + i, n, rule_, bundles_[bundle],
                                           map.normals == nullptr ? nullptr : &normals_[bundle], bounds_[bundle]);
        reached_[bundle] = reached_by(bounds_[bundle]);
      }
    }
  }
}

// Anew for all bundles: those of one gathering reach into cells of the one before.
void FisherField::list_bundles() {
  for (const std::size_t cell : listed_) begin_[cell] = end_[cell] = 0;
  listed_.clear();
  for (const Reached& cells : reached_) {
    for_each_cell_reached(cells, [&](std::size_t cell) {
      if (first_[cell]++ == 0) listed_.push_back(cell);
    });
  }
  std::uint32_t n_lists = 0;
  for (const std::size_t cell : listed_) {
    begin_[cell] = n_lists;
    n_lists += bundles_for(first_[cell]);
    end_[cell] = n_lists;
    first_[cell] = BUNDLE * begin_[cell];
  }
  lists_.resize(std::max<std::size_t>(lists_.size(), n_lists));
  for (const std::size_t cell : listed_) {
    for (float& radius : lists_[end_[cell] - 1].radius) radius = -1.0f;
  }
  for (std::size_t bundle = 0; bundle < bounds_.size(); ++bundle) {
    const BundleBounds& bounds = bounds_[bundle];
    for_each_cell_reached(reached_[bundle], [&](std::size_t cell) {
      const std::uint32_t place = first_[cell]++;
      BundleList& list = lists_[place / BUNDLE];
      list.x[place % BUNDLE] = bounds.centre[0];
      list.y[place % BUNDLE] = bounds.centre[1];
      list.z[place % BUNDLE] = bounds.centre[2];
      list.radius[place % BUNDLE] = bounds.radius;
      list.bundle[place % BUNDLE] = static_cast<std::uint32_t>(bundle);
    });
  }
  for (const std::size_t cell : listed_) first_[cell] = 0;
}

void FisherField::gather(const GaussianRows& map, const std::uint8_t* wanted) {
  first_rows_ = blocks_in(map, place_, {{chunks(0), chunks(1)}, wanted});
  sort_rows(map, wanted);
  make_bundles(map);
  list_bundles();
}

}  // namespace hgs
