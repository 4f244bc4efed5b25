// Reads and changes of the store for the services of the page.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "daemon/appliance/appliance.hpp"
#include "web/service/change.hpp"

namespace plumb {

/// An answer with a message, most often of a change that was not made.
[[nodiscard]] web::Change Refusal(web::ChangeResult result, std::string message);
/// Done where `why_not` is empty, else a conflict with the state of the appliance.
[[nodiscard]] web::Change AnswerOf(const std::string& why_not);

/// Changes run on the store's thread and call `done` on the loop; reads answer at once. Belongs to
/// the loop's thread, Read() to any. In safe mode reads give nothing and changes fail with the
/// reason.
class StoreAccess {
 public:
  /// The appliance is borrowed; lives longer.
  explicit StoreAccess(Appliance& appliance) : appliance_(appliance) {}
  /// No `done` is called from then on.
  ~StoreAccess() { *alive_ = false; }
  StoreAccess(const StoreAccess&) = delete;
  StoreAccess& operator=(const StoreAccess&) = delete;

  /// Runs `change` with one service of the store on the store's thread. What it returns is the id
  /// of what was made, if anything; what it throws becomes the answer.
  template <typename Service, typename Function>
  void Change(Service Store::*service, web::Done done, Function change) {
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

  /// What `read` makes of one service of the store. A read that fails (a damaged database) is
  /// logged and gives an empty value.
  template <typename Service, typename Function>
  [[nodiscard]] std::invoke_result_t<Function, Service&> Read(Service Store::*service,
                                                              const Function& read) const {
    return Read([&](Store& store) { return read(store.*service); });
  }
  /// The same for what needs several of them.
  template <typename Function>
  [[nodiscard]] std::invoke_result_t<Function, Store&> Read(const Function& read) const {
    if (appliance_.store() == nullptr) return {};
    try {
      return read(*appliance_.store());
    } catch (const std::exception& error) {
      LogUnreadable(error);
      return {};
    }
  }

 private:
  void RunOnStoreThread(web::Done done, std::function<std::string(Store&)> change);
  static void LogUnreadable(const std::exception& error);

  Appliance& appliance_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace plumb
