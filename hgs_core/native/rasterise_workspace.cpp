#include "rasterise_workspace.hpp"

#include <memory>
#include <mutex>
#include <vector>

namespace hgs {
namespace {

struct Pool {
  std::mutex mutex;
  std::vector<std::unique_ptr<Workspace>> idle;
};

Pool& pool() {
  static Pool instance;
  return instance;
}

}  // namespace

WorkspaceLease::WorkspaceLease() {
  Pool& shared = pool();
  const std::lock_guard lock(shared.mutex);
  if (shared.idle.empty()) {
    workspace_ = new Workspace;
  } else {
    workspace_ = shared.idle.back().release();
    shared.idle.pop_back();
  }
}

WorkspaceLease::~WorkspaceLease() {
  Pool& shared = pool();
  const std::lock_guard lock(shared.mutex);
  shared.idle.emplace_back(workspace_);
}

}  // namespace hgs
