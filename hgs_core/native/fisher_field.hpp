// Gaussians in bundles by where they are, so that a ray finds those it meets, and the exact Fisher score along rays.
#pragma once
#include <cstdint>
#include <vector>

#include "fisher_rays.hpp"
#include "gain_kernels.hpp"

namespace hgs {

// A cell is CELL_VOXELS voxels wide, and a chunk of voxels a whole number of cells.
inline constexpr int CELL_VOXELS = 2;
inline constexpr int CHUNK_CELLS = CHUNK / CELL_VOXELS;

// Filled by the same chunks of columns as the gain field of the voxels; emptied as a whole.
class FisherField {
 public:
  FisherField(const Grid& voxels, const GridPlace& place, const FisherRule& rule);

  std::int64_t chunks(int axis) const { return (grid_.shape[axis] + CHUNK_CELLS - 1) / CHUNK_CELLS; }
  void clear();
  // Bundles the map's Gaussians in the wanted chunks, which are empty before.
  void gather(const GaussianRows& map, const std::uint8_t* wanted);
  // Along each ray of the panoramas of n places, per pixel of a camera of focal length 1: scores (n, elevation,
  // azimuth). `panorama` needs its directions only. The map is the one that was gathered;
  // information (n, 8): H_train.
  void score(const GaussianRows& map, const float* information, const double* positions, std::int64_t n_positions,
             const Panorama& panorama, FisherScore* scores) const;

 private:
  struct Place { std::uint32_t part, row; };
  struct Reached { std::int32_t low[3], high[3]; };  // the cells of a bundle, along each axis
  struct FilledCell { std::uint32_t first, n; };  // in `order_`
  // One azimuth bin of a place's panorama, and what it looks at.
  struct Column { std::uint64_t target; std::int32_t place, azimuth; };

  void sort_rows(const GaussianRows& map, const std::uint8_t* wanted);
  void make_bundles(const GaussianRows& map);
  void list_bundles();
  Reached reached_by(const BundleBounds& bounds) const;
  std::vector<Column> by_target(const FisherCells& cells, const double* positions, std::int64_t n_positions,
                                std::int64_t n_azimuth) const;
  template <class Visit>
  void for_each_cell(std::size_t chunk, Visit&& visit) const;
  template <class Visit>
  void for_each_cell_reached(const Reached& cells, Visit&& visit) const;

  GridPlace place_;  // of the voxels
  FisherGrid grid_;
  FisherRule rule_;
  std::vector<Bundle> bundles_;
  std::vector<BundleNormals> normals_;      // of each bundle of discs
  std::vector<BundleBounds> bounds_;        // of each bundle
  std::vector<Reached> reached_;
  std::vector<BundleList> lists_;
  std::vector<std::uint32_t> begin_, end_;  // of each cell, in `lists_`
  std::vector<std::size_t> listed_;         // the cells for which they are not 0

  // What is left of a gathering is of no use, but for its memory.
  std::vector<std::int64_t> first_rows_;  // of the blocks
  std::vector<std::uint32_t> keys_;       // of their rows, see ListCells
  std::vector<std::uint8_t> is_wanted_;   // of each cell
  std::vector<std::uint32_t> counts_;     // per thread and cell; then where the thread's next row goes
  std::vector<FilledCell> filled_;
  std::vector<Place> order_;              // by cell, then as in the map
  std::vector<std::uint32_t> first_;      // of each cell, 0 between gatherings: its bundles counted; then where the next goes
};

}  // namespace hgs
