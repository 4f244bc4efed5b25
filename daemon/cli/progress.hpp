// SPDX-License-Identifier: Apache-2.0
// Shows the progress of a command on stderr.
#pragma once

#include <optional>
#include <string>

#include "algo/base/message.hpp"

namespace plumb {

/// A bar that is redrawn in place on a terminal, or one plain line per step elsewhere. Not
/// thread-safe.
class Progress {
 public:
  /// @param quiet  Prints nothing.
  explicit Progress(const Catalogue& language, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// @param step      The current step, such as say::progress::Tracking().
  /// @param fraction  Completed fraction of the step, 0..1.
  /// @param detail    Shown after the bar, such as say::cli::Frames().
  void Update(const Message& step, double fraction, const Message& detail = {});

  /// Removes the bar, so that other text can follow.
  void Clear();

 private:
  void Draw(double fraction, const Message& detail);

  const Catalogue& language_;
  const bool quiet_;
  const bool is_terminal_;
  bool is_drawn_ = false;
  std::optional<double> last_draw_s_;
  std::string step_;
};

}  // namespace plumb
