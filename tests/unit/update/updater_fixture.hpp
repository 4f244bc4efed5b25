// SPDX-License-Identifier: Apache-2.0
// The updater on its loop, with a RAUC that does what a test says.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "daemon/update/updater.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/support/updater_on_loop.hpp"
#include "tests/unit/update/fake_rauc.hpp"

namespace plumb::testing {

class UpdaterTest : public UpdaterOnLoop {
 protected:
  UpdaterTest() {
    std::filesystem::create_directories(folder_ / "updates");
    WriteBundle("plumb-9.0.raucb");
  }

  /// As RAUC's plain and verity bundles are laid out: a squashfs, a signature, its size in eight
  /// bytes.
  void WriteBundle(const std::string& name, const std::string& magic = "hsqs",
                   unsigned char signature_size = 0xFF, std::size_t bytes = 8192) {
    std::string text = magic + std::string(bytes, 'x') + std::string(7, '\0');
    text += static_cast<char>(signature_size);
    std::ofstream(folder_ / "updates" / name, std::ios::binary) << text;
  }

  /// Runs the test beside the loop, with a RAUC on the bus that the updater has found.
  void PlayWithRauc(const std::function<void(FakeRauc&)>& test) {
    RunBesideLoop([&] {
      FakeRauc rauc(bus_.address());
      Start();
      WaitForRauc();
      test(rauc);
    });
  }

  void Start() {
    On([this] {
      updater_ = std::make_unique<Updater>(
          loop_, UpdaterOptions{
                     .folder = folder_ / "updates",
                     .max_bytes = 1 << 20,
                     .bus_address = bus_address_,
                     .version = "0.1.0",
                     .boot = boot_,
                     .blocking_reason =
                         [this] {
                           return blocking_reason_.empty() ? Message()
                                                           : Message::Verbatim(blocking_reason_);
                         },
                     .changed = [this] { ++num_changes_; },
                     .run_in_background = run_in_background_,
                     .ended =
                         [this](const std::string& bundle, const Message& failure) {
                           ended_ = bundle + ": " + failure.English();
                         },
                     .rolled_back = [this](const Message& why) { roll_backs_ += why.English(); },
                     .answer_within = answer_within_,
                     .look_every = std::chrono::milliseconds(1),
                     .now =
                         [this] {
                           ++num_looks_;
                           return EventLoop::Clock::time_point() + passed_.load();
                         }});
    });
  }

  [[nodiscard]] std::string Ended() {
    std::string ended;
    On([&] { ended = ended_; });
    return ended;
  }

  void WaitForRauc() {
    ASSERT_TRUE(Becomes([&] { return StatusNow().supported; }));
  }

  TempFolder folder_;
  PrivateBus bus_{folder_.path()};
  std::string bus_address_ = bus_.address();
  std::chrono::milliseconds answer_within_ = std::chrono::minutes(1);
  int num_changes_ = 0;
  std::string blocking_reason_;
  std::function<bool(std::function<void()>)> run_in_background_;  ///< Empty: on the loop.
  std::string ended_, roll_backs_;
  std::string boot_ = "first";
  std::atomic<std::chrono::seconds> passed_{std::chrono::seconds(0)};
  std::atomic<int> num_looks_ = 0;
};

}  // namespace plumb::testing
