// SPDX-License-Identifier: Apache-2.0
// Reads and changes of the store for the services of the page.
#pragma once

#include <exception>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/appliance/notices.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/storage/storage_watch.hpp"
#include "web/model/change.hpp"

namespace plumb {

/// Done if `why_not` is empty, otherwise a conflict with the state of the appliance.
[[nodiscard]] Change AnswerOf(const Message& why_not);
/// Answers so and returns true if there is a reason against the change.
[[nodiscard]] bool RefuseIf(const Message& why_not, const Done& done);

/// Changes run on the store's thread and call `done` on the loop; reads answer at once. Used on the
/// loop's thread, Read() on any. In safe mode without a store reads return nothing, and changes
/// fail with the reason.
class StoreAccess {
 public:
  /// Everything is borrowed and outlives this object. No `done` is called after its end.
  /// @param changes  The store's thread.
  StoreAccess(EventLoop& loop, const StorageWatch& storage, WorkThread& changes, Notices& notices)
      : loop_(loop), storage_(storage), changes_(changes), notices_(notices) {}

  /// Whether there is a store to read.
  [[nodiscard]] bool IsThere() const { return storage_.store() != nullptr; }

  /// Runs `change` with one service of the store on the store's thread. Its return value is the id
  /// of a new record, if any; its exceptions become the answer.
  template <typename Service, typename Function>
  void Write(Service Store::*service, Done done, Function change) {
    RunOnStoreThread(std::move(done),
                     [service, change = std::move(change)](Store& store) -> std::string {
                       using Result = std::invoke_result_t<const Function&, Service&>;
                       if constexpr (std::is_void_v<Result>) {
                         change(store.*service);
                         return {};
                       } else {
                         return change(store.*service);
                       }
                     });
  }

  /// Result of `read` with one service of the store. A read that fails (a damaged database) is
  /// logged and must not look as if there were nothing.
  /// @throws IoError with the reason
  template <typename Service, typename Function>
  [[nodiscard]] std::invoke_result_t<Function, Service&> Read(Service Store::*service,
                                                              const Function& read) const {
    return Read([&](Store& store) { return read(store.*service); });
  }
  /// The same for reads that need several services.
  template <typename Function>
  [[nodiscard]] std::invoke_result_t<Function, Store&> Read(const Function& read) const {
    Store* const store = storage_.store().get();
    if (store == nullptr) return {};
    try {
      return read(*store);
    } catch (const std::exception& error) {
      throw IoError(Unreadable(error));
    }
  }
  /// The same where an empty value is the safe answer: no account, no screen.
  template <typename Service, typename Function>
  [[nodiscard]] std::invoke_result_t<Function, Service&> ReadOrNothing(Service Store::*service,
                                                                       const Function& read) const {
    try {
      return Read(service, read);
    } catch (const IoError&) {
      return {};
    }
  }
  /// Why `read` gives no answer; empty: it does.
  [[nodiscard]] Message WhyUnreadable(const std::function<void(Store&)>& read) const;

 private:
  void RunOnStoreThread(Done done, std::function<std::string(Store&)> change);
  /// What is said of it, in the log too.
  static Message Unreadable(const std::exception& error);

  EventLoop& loop_;
  const StorageWatch& storage_;
  WorkThread& changes_;
  Notices& notices_;
  AliveFlag alive_;
};

}  // namespace plumb
