// SPDX-License-Identifier: Apache-2.0
// The findings of `plumb doctor`.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "words/doctor.hpp"

namespace plumb {

class DoctorReport {
 public:
  void Good(Message what, Message found) {
    findings_.push_back({State::kGood, std::move(what), std::move(found), {}, kDone});
  }
  /// Does not prevent anything from working.
  void Note(Message what, Message found, Message remedy) {
    findings_.push_back(
        {State::kNote, std::move(what), std::move(found), std::move(remedy), kDone});
  }
  /// @param exit_code  With which a command that needs it would end.
  void Bad(Message what, Message found, Message remedy, int exit_code = kDeviceFailed) {
    findings_.push_back(
        {State::kBad, std::move(what), std::move(found), std::move(remedy), exit_code});
  }

  /// kDone if nothing necessary is missing, otherwise the code of the first missing item.
  [[nodiscard]] int exit_code() const {
    for (const Finding& finding : findings_) {
      if (finding.state == State::kBad) return finding.exit_code;
    }
    return kDone;
  }
  [[nodiscard]] bool ready() const { return exit_code() == kDone; }

  [[nodiscard]] std::string Text(const Catalogue& language) const {
    const auto said = [&](const Message& message) { return plumb::Text(message, language); };
    std::string text;
    for (const Finding& finding : findings_) {
      const Message mark = finding.state == State::kGood   ? say::doctor::Good()
                           : finding.state == State::kNote ? say::doctor::Note()
                                                           : say::doctor::Bad();
      text += fmt::format("{}  {} {}\n", LeftAligned(said(mark), 4),
                          LeftAligned(said(finding.what), 14), said(finding.found));
      if (!finding.remedy.empty()) text += fmt::format("{:21}-> {}\n", "", said(finding.remedy));
    }
    return text + said(ready() ? say::doctor::Ready() : say::doctor::NotReady()) + "\n";
  }

  [[nodiscard]] nlohmann::ordered_json Json() const {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Finding& finding : findings_) {
      const char* state = finding.state == State::kGood   ? "ok"
                          : finding.state == State::kNote ? "note"
                                                          : "bad";
      nlohmann::ordered_json& one = list.emplace_back();
      one["state"] = state;
      const auto put = [&one](const std::string& key, const Message& message) {
        one[key] = message.English();
        one[key + "_message"] = message.empty() ? nlohmann::ordered_json() : MessageJson(message);
      };
      put("what", finding.what);
      put("found", finding.found);
      put("remedy", finding.remedy);
    }
    return {{"ready", ready()}, {"findings", list}};
  }

 private:
  enum class State { kGood, kNote, kBad };
  struct Finding {
    State state = State::kGood;
    Message what;
    Message found;
    Message remedy;
    int exit_code = kDone;
  };

  std::vector<Finding> findings_;
};

}  // namespace plumb
