// SPDX-License-Identifier: Apache-2.0
// The exceptions that cross module boundaries. Poor quality is never an exception; it is a field of
// a result.
#pragma once

#include <exception>
#include <memory>
#include <stdexcept>
#include <string>

#include "algo/base/message.hpp"

namespace plumb {

/// An error that a person may read. what() is its English sentence, for logs.
class MessageError : public std::runtime_error {
 public:
  explicit MessageError(Message message)
      : std::runtime_error(message.English()),
        message_(std::make_shared<const Message>(std::move(message))) {}
  /// Verbatim, as it came from a library or from the system.
  explicit MessageError(const std::string& english) : MessageError(Message::Verbatim(english)) {}

  [[nodiscard]] const Message& message() const noexcept { return *message_; }

 private:
  std::shared_ptr<const Message> message_;  // Copying an exception must not throw.
};

/// A person asked for something that cannot be done so, such as a backup into the folder that it is
/// of. The message names what to ask for instead. Exit code 2 on the command line.
class InvalidRequest : public std::invalid_argument {
 public:
  explicit InvalidRequest(Message message)
      : std::invalid_argument(message.English()),
        message_(std::make_shared<const Message>(std::move(message))) {}

  [[nodiscard]] const Message& message() const noexcept { return *message_; }

 private:
  std::shared_ptr<const Message> message_;
};

/// The message of a MessageError or an InvalidRequest, else the text of the error verbatim.
[[nodiscard]] inline Message MessageOf(const std::exception& error) {
  if (const auto* told = dynamic_cast<const MessageError*>(&error)) return told->message();
  if (const auto* told = dynamic_cast<const InvalidRequest*>(&error)) return told->message();
  return Message::Verbatim(error.what());
}

/// Input data (a recording, a scene, a configuration) is missing, damaged or contradictory. The
/// message names what failed, on what, what was expected and found, and what to do. Exit code 3 on
/// the command line.
class DataError : public MessageError {
 public:
  using MessageError::MessageError;
};

/// The system refused one of our writes or reads (disk full, permission). Exit code 1.
class IoError : public MessageError {
 public:
  using MessageError::MessageError;
};

/// A sensor or another device failed. Exit code 5.
class DeviceError : public MessageError {
 public:
  using MessageError::MessageError;
};

/// The device was unplugged while in use.
class DeviceLost : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// Work was stopped on request (Ctrl-C or cancel). Exit code 130.
class Interrupted : public MessageError {
 public:
  using MessageError::MessageError;
};

}  // namespace plumb
