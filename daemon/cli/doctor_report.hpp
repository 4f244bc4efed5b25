// The findings of `plumb doctor`.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/cli/commands.hpp"

namespace plumb {

class DoctorReport {
 public:
  void Good(std::string what, std::string found) {
    findings_.push_back({State::kGood, std::move(what), std::move(found), {}, kDone});
  }
  /// Does not prevent anything from working.
  void Note(std::string what, std::string found, std::string remedy) {
    findings_.push_back(
        {State::kNote, std::move(what), std::move(found), std::move(remedy), kDone});
  }
  /// @param exit_code  With which a command that needs it would end.
  void Bad(std::string what, std::string found, std::string remedy, int exit_code = kDeviceFailed) {
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

  [[nodiscard]] std::string Text() const {
    std::string text;
    for (const Finding& finding : findings_) {
      const char* mark = finding.state == State::kGood   ? "ok  "
                         : finding.state == State::kNote ? "note"
                                                         : "BAD ";
      text += fmt::format("{}  {:<14} {}\n", mark, finding.what, finding.found);
      if (!finding.remedy.empty()) text += fmt::format("{:21}-> {}\n", "", finding.remedy);
    }
    return text + (ready() ? "Ready to scan.\n" : "Not ready to scan: see BAD above.\n");
  }

  [[nodiscard]] nlohmann::ordered_json Json() const {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Finding& finding : findings_) {
      const char* state = finding.state == State::kGood   ? "ok"
                          : finding.state == State::kNote ? "note"
                                                          : "bad";
      list.push_back({{"state", state},
                      {"what", finding.what},
                      {"found", finding.found},
                      {"remedy", finding.remedy}});
    }
    return {{"ready", ready()}, {"findings", list}};
  }

 private:
  enum class State { kGood, kNote, kBad };
  struct Finding {
    State state = State::kGood;
    std::string what;
    std::string found;
    std::string remedy;
    int exit_code = kDone;
  };

  std::vector<Finding> findings_;
};

}  // namespace plumb
