// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/peers_settings.hpp"

#include "daemon/config/messages_settings.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostPeers = 8;

bool IsPeer(const std::string& text) {
  const auto url = ParsePlainUrl(text);
  return url && url->path.empty() &&
         (url->scheme == "https" || (url->scheme == "http" && !url->LeavesTheMachine()));
}

}  // namespace

PeersSettings ReadPeersSettings(Section section) {
  PeersSettings settings;
  section.TakeNames("units", settings.units, say::config::ExpectedPeers(), kMostPeers, IsPeer);
  section.TakePath("secret_file", settings.secret_file);
  section.TakePath("trusted", settings.trusted);
  section.RejectUnknownKeys();
  if (!settings.units.empty() && settings.secret_file.empty())
    throw DataError(say::config::PeersNeedSecret());
  return settings;
}

}  // namespace plumb
