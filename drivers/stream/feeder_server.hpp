// SPDX-License-Identifier: Apache-2.0
// The socket at which programs deliver frames, and the one program that is connected.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include <nlohmann/json.hpp>

#include "drivers/files/descriptor.hpp"
#include "drivers/live/frame_box.hpp"
#include "drivers/live/sensor_events.hpp"
#include "drivers/sensor.hpp"
#include "drivers/stream/stream_protocol.hpp"

namespace plumb::stream {

/// The longest time to the first message of a feeder, and from one message to the next.
inline constexpr std::chrono::seconds kPatience{3};

/// What is connected.
struct Feeder {
  SensorDescription description;
  Hello hello;
};

/// Listens as long as it lives. A program that hangs up, stalls or violates the protocol counts as
/// an unplugged sensor; a program that is refused is told why. Memory is bounded by two images.
/// Thread-safe.
class FeederServer {
 public:
  /// @throws DeviceError if it cannot listen there.
  explicit FeederServer(std::filesystem::path socket);
  ~FeederServer();
  FeederServer(const FeederServer&) = delete;
  FeederServer& operator=(const FeederServer&) = delete;

  /// The connected program, once it has introduced itself.
  [[nodiscard]] std::optional<Feeder> feeder() const;
  /// From now on its images go into the box. False if it is not connected any more.
  [[nodiscard]] bool Deliver(const std::string& uri, const std::shared_ptr<FrameBox>& box);
  /// A line for the program; dropped if it does not read.
  void Tell(const nlohmann::json& line);
  [[nodiscard]] SensorEvents& events() { return events_; }

 private:
  struct Gone {};  ///< Thrown where the connection, or this server, has ended.
  void Run(const std::stop_token& stop);
  void Serve(int connection);
  void ReadExactly(int connection, void* to, std::size_t size,
                   std::chrono::steady_clock::time_point until);
  Hello ReadHello(int connection);
  void ReadImage(int connection, const Hello& hello);
  void RefuseSecond();
  /// The program that waits; nothing (a closed descriptor) if it cannot be accepted now, as where
  /// the process has no free descriptor. It goes on waiting, and poll() would return at once: the
  /// socket is then left alone until the next try.
  [[nodiscard]] Descriptor Accept();
  /// The socket for poll(), or -1, which it ignores; `wait` is then shortened to the next try.
  [[nodiscard]] int ListeningNow(std::optional<std::chrono::milliseconds>& wait) const;

  const std::filesystem::path socket_;
  Descriptor listening_;
  Descriptor wake_;  ///< Readable once the thread is to end.
  SensorEvents events_;
  mutable std::mutex mutex_;
  std::optional<Feeder> feeder_;  ///< Guarded, and the next two.
  std::weak_ptr<FrameBox> box_;
  int connection_ = -1;
  std::int64_t num_connected_ = 0;  ///< Of the thread only, and the next one.
  std::chrono::steady_clock::time_point listen_again_ = {};
  std::jthread thread_;  ///< Last: starts when the members above are initialised.
};

}  // namespace plumb::stream
