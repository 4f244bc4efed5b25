// SPDX-License-Identifier: Apache-2.0
// Lines for systemd's journal that never wait for it: sd_journal_sendv() would hold up the event
// loop as long as the journal does not read.
#pragma once

#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumb {

/// Thread-safe.
class JournalSender {
 public:
  using Fields = std::vector<std::pair<std::string, std::string>>;

  explicit JournalSender(std::string socket = "/run/systemd/journal/socket");
  ~JournalSender();
  JournalSender(const JournalSender&) = delete;
  JournalSender& operator=(const JournalSender&) = delete;

  /// Sends an entry. One for which there is no room is left out; the next one that is sent says how
  /// many were.
  void Send(std::string_view message, const Fields& fields);

 private:
  const std::string socket_path_;
  std::mutex mutex_;
  const int socket_;
  long num_lost_ = 0;
};

}  // namespace plumb
