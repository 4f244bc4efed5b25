// SPDX-License-Identifier: Apache-2.0
// Waits for senders; each connection gets a process of its own.
#pragma once

#include <functional>
#include <map>
#include <string>

#include <sys/types.h>

#include "daemon/config/dicom_settings.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {

/// One line of the journal.
void Audit(const std::string& line);

/// A port that is open until the end of the object. Not thread-safe; the process must have one
/// thread.
class Listener {
 public:
  /// @throws IoError if the address cannot be used.
  explicit Listener(const DicomSettings& settings);

  [[nodiscard]] std::uint16_t port() const { return port_; }

  /// Until a signal asks to stop: forks for each connection of a known address, and calls `serve`
  /// in the child with the connection and the address.
  void Run(const std::function<void(int connection, const std::string& address)>& serve);

 private:
  void AcceptOne(const std::function<void(int, const std::string&)>& serve);
  void ReapEnded();

  const DicomSettings& settings_;
  Descriptor socket_;
  std::uint16_t port_ = 0;
  std::map<pid_t, std::string> children_;  ///< With the address that each serves.
};

}  // namespace plumb
