// SPDX-License-Identifier: Apache-2.0
// Looks at a channel of updates once a day and fetches what is meant for this unit. It installs
// nothing: what it fetched lies among the bundles, where a person finds it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "algo/base/message.hpp"
#include "daemon/update/channel_index.hpp"

namespace plumb {

struct ChannelOptions {
  std::string url = {};  ///< Of the folder, without a slash at its end.
  std::string channel = "stable";
  std::string key = {};                ///< Public key in base64.
  std::filesystem::path trusted = {};  ///< Certificates, PEM; empty: those of the system.
  std::filesystem::path folder = {};   ///< Of the bundles.
  std::filesystem::path seen = {};     ///< File with the number of the newest index.
  std::string serial = {};             ///< Of this unit.
  std::string version = {};            ///< That runs.
  std::uint64_t max_bytes = std::uint64_t{2} << 30;  ///< Limit for one bundle.
  std::chrono::milliseconds every = std::chrono::hours(24);
  std::chrono::milliseconds again_after = std::chrono::hours(1);  ///< After a failure.
  std::chrono::milliseconds first_after = std::chrono::minutes(5);
};

/// What came of a look.
struct ChannelLook {
  std::string name, version;  ///< Of the bundle that is here; empty: there is none for this unit.
  Message failure;            ///< Why nothing could be looked at or fetched.
};

/// One look, which may take as long as a download; from any thread. A partial download stays in the
/// folder and is continued by the next look, if the index still names the same contents.
[[nodiscard]] ChannelLook LookAtChannel(const ChannelOptions& options, const std::stop_token& stop);

/// Looks at regular times, on a thread of its own.
class ChannelWatch {
 public:
  /// @param looked  Called after each look, on that thread.
  ChannelWatch(ChannelOptions options, std::function<void(const ChannelLook&)> looked);

 private:
  const ChannelOptions options_;
  const std::function<void(const ChannelLook&)> looked_;
  std::jthread thread_;  // last: it uses the members above
};

}  // namespace plumb
