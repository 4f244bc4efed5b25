// SPDX-License-Identifier: Apache-2.0
// The store that an appliance uses.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/records/store.hpp"

namespace plumb {

/// Read from any thread, replaced on one. A replaced store is not closed, because other threads may
/// be using it, and because closing a file gives up the locks of the whole process on it.
class CurrentStore {
 public:
  void Replace(std::unique_ptr<Store> store) {
    current_ = store.get();
    opened_.push_back(std::move(store));
  }

  [[nodiscard]] Store* get() const { return current_; }
  Store* operator->() const { return current_; }
  explicit operator bool() const { return current_ != nullptr; }
  bool operator==(std::nullptr_t) const { return current_ == nullptr; }

 private:
  std::vector<std::unique_ptr<Store>> opened_;
  std::atomic<Store*> current_ = nullptr;
};

}  // namespace plumb
