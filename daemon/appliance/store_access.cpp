#include "daemon/appliance/store_access.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"

namespace plumb {

Change AnswerOf(const std::string& why_not) {
  return Refused(why_not.empty() ? ChangeResult::kDone : ChangeResult::kConflict, why_not);
}

bool RefuseIf(const std::string& why_not, const Done& done) {
  if (!why_not.empty()) done(AnswerOf(why_not));
  return !why_not.empty();
}

std::string StoreAccess::Unreadable(const std::exception& error) {
  std::string text = fmt::format("what is stored cannot be read: {}", error.what());
  Log(LogLevel::kError, text);
  return text;
}

std::string StoreAccess::WhyUnreadable(const std::function<void(Store&)>& read) const {
  if (appliance_.store() == nullptr) return appliance_.storage_fault();
  try {
    read(*appliance_.store());
  } catch (const std::exception& error) {
    return Unreadable(error);
  }
  return {};
}

void StoreAccess::RunOnStoreThread(Done done, std::function<std::string(Store&)> change) {
  Store* store = appliance_.store();
  if (store == nullptr) return done(Refused(ChangeResult::kFailed, appliance_.storage_fault()));
  // The store's thread outlives this object, which must not be used there.
  const auto changed = alive_.WhileAlive([appliance = &appliance_, done](const Change& answer) {
    done(answer);
    if (answer.result == ChangeResult::kDone) appliance->NotifyWeb(web::EventKind::kData);
  });
  const bool posted = appliance_.store_thread().Post(
      [store, changed, loop = &appliance_.loop(), change = std::move(change)] {
        Change answer;
        try {
          answer.id = change(*store);
        } catch (const StoreRefusal& refusal) {
          answer = Refused(refusal.result(), refusal.what());
        } catch (const DiskRefused& error) {
          answer = Refused(ChangeResult::kNoSpace, error.what());
        } catch (const std::exception& error) {
          answer = Refused(ChangeResult::kFailed, error.what());
        }
        loop->Post("store changed", [changed, answer] { changed(answer); });
      });
  if (!posted) done(Refused(ChangeResult::kFailed, "the store is busy: try again"));
}

}  // namespace plumb
