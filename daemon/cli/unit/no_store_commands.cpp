// SPDX-License-Identifier: Apache-2.0
// Linked in place of store_commands.cpp in a build without the appliance.
#include "daemon/cli/commands.hpp"

namespace plumb {

std::span<const CommandEntry> StoreCommands() { return {}; }

}  // namespace plumb
