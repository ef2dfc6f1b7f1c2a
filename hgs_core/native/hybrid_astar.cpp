// Hybrid A*: states are the cells of (x, y, heading), each with the continuous pose that first reached it; steps are
// short arcs and straights both ways; from states on the way Reeds-Shepp words are tried straight to the goal.
// D. Dolgov, S. Thrun, M. Montemerlo, J. Diebel, "Path planning for autonomous vehicles in unknown semi-structured
// environments", 2010.
#include <functional>
#include <memory>
#include <queue>
#include <utility>

#include "car_departure.hpp"
#include "car_way.hpp"

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kHeadings = 72;
constexpr double kStep = 1.8;                // cells: leaves the cell, whatever the heading
constexpr double kTurns[5] = {0.0, 1.0, -1.0, 0.5, -0.5};
constexpr double kOctile = 1.0823922;        // a way over cells is longer than a straight one by at most this factor
constexpr double kTryEvery = 12.0;           // cells left to go for each state without a try to end by a word

struct Node {
  Pose pose;
  double cost;
  int32_t parent;
  Piece piece;  // that led here
  bool closed;
};

// States by cell and heading; room for a cell's headings is made when the first of them is reached.
class StateIndex {
 public:
  explicit StateIndex(size_t n_cells) : block_(n_cells, -1) {}

  int32_t& operator()(int32_t cell, int heading) {
    if (block_[cell] < 0) {
      block_[cell] = static_cast<int32_t>(nodes_.size());
      nodes_.resize(nodes_.size() + kHeadings, -1);
    }
    return nodes_[static_cast<size_t>(block_[cell]) + heading];
  }

 private:
  std::vector<int32_t> block_, nodes_;
};

int heading_of(double yaw) {
  const int h = static_cast<int>(std::lround(yaw * kHeadings / (2.0 * kPi)) % kHeadings);
  return h < 0 ? h + kHeadings : h;
}

class Search {
 public:
  Search(const FloorGrid& floor, const float* cost, const Car& car, const Pose* goals, int n_goals, const Pose& start,
         const CarSearch& limits)
      : floor_(floor), car_(car), goals_(goals), n_goals_(n_goals), limits_(limits), space_(floor, car.body),
        index_(static_cast<size_t>(floor.nx) * floor.ny) {
    space_.forgive(start);
    const size_t n_cells = static_cast<size_t>(floor.nx) * floor.ny;
    const int32_t goal = cell_of(goals[0]);
    to_goal_.assign(n_cells, kInfinity);
    std::vector<int32_t> parent(n_cells);
    const double nothing = 0.0;
    if (goal >= 0) grid_dijkstra({cost, floor.nx, floor.ny}, &goal, &nothing, 1, to_goal_.data(), parent.data());
  }

  const CarSpace& space() const { return space_; }

  std::vector<Piece> run(const Pose& start, int* expanded) {
    *expanded = 0;
    std::vector<int> free_goals;
    for (int g = 0; g < n_goals_; ++g) {
      if (space_.is_free(goals_[g])) free_goals.push_back(g);
    }
    if (free_goals.empty() || cell_of(start) < 0) return {};
    reach({start, 0.0, -1, {0.0, 0.0}, false});
    std::vector<Piece> way = searched(free_goals, expanded);
    if (way.empty() && *expanded < limits_.most_expanded) {  // no step of the lattice leads far: shorter ones may
      depart(start);
      way = searched(free_goals, expanded);
    }
    return way;
  }

 private:
  using Entry = std::pair<double, int32_t>;

  // From what waits in the queue, as long as there is patience.
  std::vector<Piece> searched(const std::vector<int>& free_goals, int* expanded) {
    double patience = 0.0;
    double best = kInfinity;  // cost of the best complete way
    int32_t best_node = -1;
    std::vector<Piece> best_word;
    while (!queue_.empty()) {
      const auto [priority, node] = queue_.top();
      queue_.pop();
      if (priority >= best || *expanded >= limits_.most_expanded) break;
      if (nodes_[node].closed) continue;
      nodes_[node].closed = true;
      ++*expanded;
      patience -= 1.0;
      if (patience <= 0.0) {
        const Node from = nodes_[node];
        for (const int g : free_goals) {
          std::vector<Piece> word;
          const double cost = cheapest_word(floor_, space_, car_, from.pose, goals_[g], from.piece, {0.0, 0.0},
                                            best - from.cost, word);
          if (cost == kInfinity) continue;
          best = from.cost + cost;
          best_node = node;
          best_word = std::move(word);
        }
        patience = std::max(1.0, heuristic(from.pose) / kTryEvery);
      }
      expand(node);
    }
    if (best_node < 0) return {};
    std::vector<Piece> way;
    for (int32_t node = best_node; nodes_[node].parent >= 0; node = nodes_[node].parent) way.push_back(nodes_[node].piece);
    std::reverse(way.begin(), way.end());
    way.insert(way.end(), best_word.begin(), best_word.end());
    return way;
  }

  // Begins anew with all that short pieces lead to.
  void depart(const Pose& start) {
    nodes_.clear();
    index_ = StateIndex(static_cast<size_t>(floor_.nx) * floor_.ny);
    for (const Departure& to : departures(space_, car_, start)) {
      double cost = 0.0;
      if (to.parent >= 0) {
        const Node& from = nodes_[static_cast<size_t>(to.parent)];
        cost = from.cost + drive_cost(floor_, nullptr, car_, from.pose, to.piece) +
               change_cost(car_.costs, from.piece, to.piece);
      }
      const auto number = static_cast<int32_t>(nodes_.size());
      nodes_.push_back({to.pose, cost, to.parent, to.piece, false});
      const int32_t cell = cell_of(to.pose);
      const double left = cell < 0 ? kInfinity : heuristic(to.pose);
      if (left == kInfinity) continue;
      int32_t& known = index_(cell, heading_of(to.pose.yaw));
      if (known >= 0 && nodes_[static_cast<size_t>(known)].cost <= cost) continue;
      known = number;
      queue_.emplace(cost + limits_.weight * left, number);
    }
  }

  int32_t cell_of(const Pose& pose) const {
    if (!(pose.x >= 0.0 && pose.y >= 0.0 && pose.x < floor_.nx && pose.y < floor_.ny)) return -1;
    return static_cast<int32_t>(pose.x) * floor_.ny + static_cast<int32_t>(pose.y);
  }

  double heuristic(const Pose& pose) const {
    const double away = std::hypot(goals_[0].x - pose.x, goals_[0].y - pose.y);
    const int32_t cell = cell_of(pose);
    double least = std::max(away, cell < 0 ? 0.0 : (to_goal_[cell] - 1.0) / kOctile);
    double word = kInfinity;
    for (int g = 0; g < n_goals_; ++g)
      word = std::min(word, reeds_shepp_bound(seen_from(pose, goals_[g], car_.radius)) * car_.radius);
    return std::max(least, word);
  }

  void reach(const Node& node) {
    int32_t& known = index_(cell_of(node.pose), heading_of(node.pose.yaw));
    if (known >= 0 && (nodes_[known].closed || nodes_[known].cost <= node.cost)) return;
    const double left = heuristic(node.pose);
    if (left == kInfinity) return;
    known = static_cast<int32_t>(nodes_.size());
    nodes_.push_back(node);
    queue_.emplace(node.cost + limits_.weight * left, known);
  }

  void expand(int32_t at) {
    const Node from = nodes_[at];
    for (const double length : {kStep, -kStep}) {
      for (const double turn : kTurns) {
        const Piece piece{turn, length};
        const Pose to = after(from.pose, piece, car_.radius);
        const int32_t cell = cell_of(to);
        if (cell < 0 || to_goal_[cell] == kInfinity) continue;
        const int32_t known = index_(cell, heading_of(to.yaw));
        if (known >= 0 && nodes_[known].closed) continue;
        const double cost = drive_cost(floor_, &space_, car_, from.pose, piece);
        if (cost == kInfinity) continue;
        reach({to, from.cost + cost + change_cost(car_.costs, from.piece, piece), at, piece, false});
      }
    }
  }

  const FloorGrid& floor_;
  const Car& car_;
  const Pose* goals_;
  int n_goals_;
  CarSearch limits_;
  CarSpace space_;
  StateIndex index_;
  std::vector<double> to_goal_;
  std::vector<Node> nodes_;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue_;
};

}  // namespace

std::vector<Piece> hybrid_astar(const FloorGrid& floor, const float* cost, const Car& car, const Pose& start,
                                const Pose* goals, int n_goals, const CarSearch& limits, int* expanded) {
  Search search(floor, cost, car, goals, n_goals, start, limits);
  std::vector<Piece> way = search.run(start, expanded);
  return way.empty() ? way : shortened_way(search.space(), floor, car, start, std::move(way));
}

}  // namespace hgs
