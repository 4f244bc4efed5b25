// SPDX-License-Identifier: Apache-2.0
// A library with libfreenect's C interface, whose Kinects the tests plug in, and whose images they
// make. A test is linked with it, and its file is given to the driver, which loads it: both get the
// same one.
#pragma once

#include <cstdint>
#include <string>

namespace plumb::fake_freenect {

struct FakeKinect {
  std::string serial = "A00367A01234046A";
  bool busy = false;           ///< It cannot be opened.
  bool has_registered = true;  ///< The library offers registered depth.
};

void Attach(FakeKinect kinect);
/// The events of a Kinect that streams report an error from now on, as the library's do.
void Detach(const std::string& serial);
/// The library calls back with the image, on the thread that processes its events. False if the
/// Kinect does not stream, or nobody takes the image within ten seconds.
bool Deliver(const std::string& serial, bool is_depth, void* image, std::uint32_t stamp);
/// The value that a flag was set to; nothing was set: -1.
[[nodiscard]] int FlagOf(const std::string& serial, int flag);
/// Contexts, opened Kinects and lists that were given out and not released.
[[nodiscard]] int NumAlive();
/// Detaches all.
void Reset();

}  // namespace plumb::fake_freenect
