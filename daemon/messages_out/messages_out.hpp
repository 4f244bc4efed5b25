// SPDX-License-Identifier: Apache-2.0
// Tells people outside what needs one: by mail, syslog and webhook, as [messages] says.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/config/messages_settings.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/messages_out/courier.hpp"
#include "daemon/messages_out/occasions.hpp"
#include "web/model/status.hpp"

namespace plumb {

/// Used on the loop's thread, which it never makes wait.
class MessagesOut {
 public:
  /// The loop is borrowed. @param changed  Called when status() has changed.
  MessagesOut(EventLoop& loop, const MessagesSettings& settings, OccasionRules rules,
              std::function<void()> changed,
              RetryPauses pauses = {std::chrono::seconds(30), std::chrono::minutes(5),
                                    std::chrono::minutes(30)});

  /// Tells what is new in a status; for regular calls.
  void Look(const Status& status, OccasionMemory::Time now = std::chrono::steady_clock::now());
  /// Sends a test message by every way, once. Calls `done` with why one did not take it, or with an
  /// empty message.
  void Test(std::function<void(const Message& failure)> done);
  [[nodiscard]] bool IsSetUp() const { return !ways_.empty(); }
  [[nodiscard]] std::vector<MessageWay> status() const;

 private:
  struct Way {
    MessageWay status;
    std::unique_ptr<Courier> courier;
  };
  /// A message whose outcome is not yet known everywhere.
  struct Open {
    OccasionKind kind = OccasionKind::kTest;
    std::size_t ways = 0;
    bool is_taken = false;  ///< By one of them.
    Message failure;
    std::function<void(const Message&)> done;  ///< Of a test.
  };
  using Send = std::string (*)(const OutMessage&, const MessagesSettings&, const std::stop_token&);

  void Add(const char* name, Send send, const RetryPauses& pauses);
  void Post(OutMessage message, std::function<void(const Message&)> done);
  void Note(std::size_t way, const Courier::Attempt& attempt);
  /// One way took the message or gave it up.
  void End(const std::string& id, const Message& failure);

  EventLoop& loop_;
  const MessagesSettings settings_;
  const OccasionRules rules_;
  const std::function<void()> changed_;
  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  OccasionMemory memory_;
  std::map<std::string, Open> open_;  ///< By the message's id.
  std::vector<Way> ways_;
  AliveFlag alive_;
};

}  // namespace plumb
