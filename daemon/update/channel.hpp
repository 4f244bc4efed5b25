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
#include "daemon/update/bundle_copy.hpp"
#include "daemon/update/channel_index.hpp"

namespace plumb {

struct ChannelOptions {
  std::string url = {};  ///< Of the folder, without a slash at its end.
  std::string channel = "stable";
  std::string key = {};                ///< Public key in base64.
  std::filesystem::path trusted = {};  ///< Certificates, PEM; empty: those of the system.
  std::filesystem::path folder = {};   ///< Of the bundles.
  std::filesystem::path state = {};    ///< Of what is remembered: see ChannelMemory.
  std::string serial = {};             ///< Of this unit.
  std::string version = {};            ///< The one that runs.
  std::uint64_t max_bytes = std::uint64_t{2} << 30;  ///< Limit for one bundle.
  std::chrono::milliseconds every = std::chrono::hours(24);
  std::chrono::milliseconds again_after = std::chrono::hours(1);  ///< After a failure.
  std::chrono::milliseconds first_after = std::chrono::minutes(5);
  /// Asked before something is removed and fetched: false while a bundle is being installed, and
  /// where none can be. From any thread; empty: always true.
  std::function<bool()> may_fetch = {};
  FreeBytes free_bytes = FreeBytesOf;
};

/// What came of a look.
struct ChannelLook {
  std::string name, version;  ///< Of the bundle that is here; empty: there is none for this unit.
  Message failure;            ///< Why nothing could be looked at or fetched.
  bool is_new = false;        ///< This look has fetched it.
  bool is_postponed = false;  ///< Nothing may be fetched now.
};

/// One look, which may take as long as a download; from any thread. A partial download stays in the
/// folder and is continued by the next look, if the index still names the same contents.
///
/// At most one bundle in the folder is the channel's: before it fetches one, it removes the one
/// that it fetched before. What a person put there is neither removed nor replaced; one that a
/// person removed is not fetched again.
[[nodiscard]] ChannelLook LookAtChannel(const ChannelOptions& options, const std::stop_token& stop);

/// Removes what earlier looks have begun to fetch.
void RemoveChannelParts(const std::filesystem::path& folder);

/// Looks at regular times, on a thread of its own, which gives way to scans.
class ChannelWatch {
 public:
  /// @param looked  Called after each look, on that thread. After a failed one it gets what the
  ///                look before has found, with the failure.
  ChannelWatch(ChannelOptions options, std::function<void(const ChannelLook&)> looked);

 private:
  const ChannelOptions options_;
  const std::function<void(const ChannelLook&)> looked_;
  std::jthread thread_;  // last: it uses the members above
};

}  // namespace plumb
