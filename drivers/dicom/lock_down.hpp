// SPDX-License-Identifier: Apache-2.0
// Gives up the rights of a process that only computes.
#pragma once

namespace plumb {

/// kNetwork: besides, new connections to other computers and traffic on them.
/// kStore: traffic on connections that are open, and files, which the service's own sandbox limits
/// to a folder; but no new connection and no program.
enum class Allowed { kComputing, kNetwork, kStore };

/// From now on no thread of the process can open a file, reach a network, start a program or touch
/// another process: every system call but those that read, write and close open files, manage
/// memory and end the process, and but what is allowed, fails with EPERM. For good.
/// @throws IoError if the kernel does not permit the filter.
void LockDown(Allowed allowed = Allowed::kComputing);

}  // namespace plumb
