// The program plumbd: options, set-up in the right order, the loop, and the way down.
#pragma once

namespace plumb {

/// Exit codes as those of plumb: 0 ended by a signal, 1 internal or I/O error, 2 usage, 3 bad
/// configuration.
int RunPlumbd(int argc, char** argv);

}  // namespace plumb
