// SPDX-License-Identifier: Apache-2.0
// Words that every presentation of a result shares: the page without script and the reports.
#pragma once

#include <string>

#include "algo/base/message.hpp"
#include "web/service/scan_service.hpp"
#include "words/result.hpp"

namespace plumb::web {

/// A text without arguments.
[[nodiscard]] inline std::string Word(MessageId id, const Catalogue& language) {
  return Text(Message(id, {}), language);
}

/// Caution to show beside a result; empty if the check had passed.
[[nodiscard]] inline Message DailyCheckCaution(DailyCheck check) {
  return check == DailyCheck::kFailed    ? say::result::CheckFailed()
         : check == DailyCheck::kOverdue ? say::result::Overdue()
                                         : Message();
}

}  // namespace plumb::web
