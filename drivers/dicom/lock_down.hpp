// SPDX-License-Identifier: Apache-2.0
// Gives up the rights of a process that only computes.
#pragma once

namespace plumb {

/// From now on no thread of the process can open a file, reach a network, start a program or touch
/// another process: every system call but those that read, write and close open files, manage
/// memory and end the process fails with EPERM. For good.
/// @throws IoError if the kernel does not permit the filter.
void LockDown();

}  // namespace plumb
