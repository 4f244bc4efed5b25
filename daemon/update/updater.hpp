// System updates through RAUC, the image's installer, over D-Bus (de.pengutronix.rauc.Installer).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "daemon/loop/event_loop.hpp"
#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// An installation whose progress (percent or step) stands still for so long has failed. RAUC says
/// nothing while it copies an image, which takes a slow card some ten minutes; each other step is
/// one of seconds.
inline constexpr std::chrono::minutes kLongestCopy{30}, kLongestOtherStep{5};

struct UpdaterOptions {
  std::filesystem::path folder = "/var/lib/plumb/updates";  ///< Bundles lie here: NAME.raucb.
  std::uint64_t max_bytes = std::uint64_t{2} << 30;         ///< Of one bundle.
  std::string bus_address;                                  ///< Empty: the system bus.
  std::string version;                           ///< Of what runs: an older bundle is refused.
  std::string boot = {};                         ///< Another text at each start of the machine.
  std::function<std::string()> blocking_reason;  ///< Asked before an installation begins: why it
                                                 ///< may not begin now; empty if it may.
  std::function<void()> changed;                 ///< Called on the loop when status() has changed.
  /// Does what takes its time on another thread: reading a whole bundle, closing a large file whose
  /// name is gone. False: it has too much to do. Empty: all is done at once, on the loop.
  std::function<bool(std::function<void()>)> aside;
  /// Called on the loop when an installation that had begun has ended; empty text: it worked.
  std::function<void(const std::string& bundle, const std::string& failure)> ended;
  /// Called on the loop, once: the machine has started the system from before the last update, and
  /// why that is known.
  std::function<void(const std::string& text)> rolled_back = {};
  std::chrono::milliseconds look_every{10'000};  ///< How often to look whether progress stands.
  /// For tests; empty: the steady clock.
  std::function<std::chrono::steady_clock::time_point()> now = {};
};

/// Nothing waits: every call of the bus is answered later. A machine without a bus or without RAUC
/// is no error: status() says so. What makes a bundle acceptable is RAUC's matter (signature,
/// compatible system); before it is asked, size and form are checked here, and the version
/// afterwards. An installation ends with RAUC's word, with RAUC leaving the bus, or with progress
/// that stands still; each time another attempt can be made. Belongs to the loop's thread.
class Updater {
 public:
  Updater(EventLoop& loop, UpdaterOptions options);
  ~Updater();
  Updater(const Updater&) = delete;
  Updater& operator=(const Updater&) = delete;

  [[nodiscard]] bool is_installing() const;
  /// Also looks again for RAUC where there was none, at most every few seconds.
  [[nodiscard]] web::UpdateStatus status();
  /// Takes a file among the bundles, by moving it: kInvalid where it can be none, kConflict where
  /// there are too many.
  web::Change Add(const std::filesystem::path& file, const std::string& name);
  web::Change Remove(const std::string& name);
  /// Has RAUC check and install NAME of the folder. `done` comes once it has begun, or with the
  /// reason why not.
  void Install(const std::string& name, web::Done done);
  /// Somebody has taken note of the roll-back: nothing reports it any more.
  void ForgetRollBack();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
