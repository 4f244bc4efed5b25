// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/store_access.hpp"

#include <utility>

#include "daemon/loop/log.hpp"
#include "words/upkeep.hpp"

namespace plumb {

Change AnswerOf(const Message& why_not) {
  return Refused(why_not.empty() ? ChangeResult::kDone : ChangeResult::kConflict, why_not);
}

bool RefuseIf(const Message& why_not, const Done& done) {
  if (!why_not.empty()) done(AnswerOf(why_not));
  return !why_not.empty();
}

Message StoreAccess::Unreadable(const std::exception& error) {
  Message why = say::upkeep::Unreadable(MessageOf(error));
  Log(LogLevel::kError, why.English());
  return why;
}

Message StoreAccess::WhyUnreadable(const std::function<void(Store&)>& read) const {
  Store* const store = storage_.store().get();
  if (store == nullptr) return storage_.fault();
  try {
    read(*store);
  } catch (const std::exception& error) {
    return Unreadable(error);
  }
  return {};
}

void StoreAccess::RunOnStoreThread(Done done, std::function<std::string(Store&)> change) {
  Store* const store = storage_.store().get();
  if (store == nullptr) return done(Refused(ChangeResult::kFailed, storage_.fault()));
  // The store's thread outlives this object, which must not be used there.
  const auto changed = alive_.WhileAlive([&notices = notices_, done](const Change& answer) {
    done(answer);
    if (answer.result == ChangeResult::kDone) notices.TellPage(web::EventKind::kData);
  });
  const bool posted = changes_.Post([store, changed, &loop = loop_, change = std::move(change)] {
    Change answer;
    try {
      answer.id = change(*store);
    } catch (const StoreRefusal& refusal) {
      answer = Refused(refusal.result(), refusal.message());
    } catch (const DiskRefused& error) {
      answer = Refused(ChangeResult::kNoSpace, error.message());
    } catch (const std::exception& error) {
      answer = Refused(ChangeResult::kFailed, MessageOf(error));
    }
    loop.Post("store changed", [changed, answer] { changed(answer); });
  });
  if (!posted) done(Refused(ChangeResult::kFailed, say::upkeep::StoreBusy()));
}

}  // namespace plumb
