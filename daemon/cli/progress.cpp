// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/progress.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <sys/ioctl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "daemon/cli/language.hpp"
#include "daemon/pipeline/scan_runner.hpp"

namespace plumb {
namespace {

constexpr double kRedraw_s = 0.1;

int TerminalWidth() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

Progress::Progress(const Catalogue& language, bool quiet)
    : language_(language), quiet_(quiet), is_terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { Clear(); }

void Progress::Update(const Message& step, double fraction, const Message& detail) {
  if (quiet_) return;
  std::string said = Text(step, language_);
  const bool is_new = said != step_;
  step_ = std::move(said);
  if (!is_terminal_) {
    if (is_new) fmt::print(stderr, "{}\n", step_);
    return;
  }
  const double now_s = SteadySeconds();
  if (!is_new && fraction < 1.0 && last_draw_s_ && now_s - *last_draw_s_ < kRedraw_s) return;
  last_draw_s_ = now_s;
  Draw(std::clamp(fraction, 0.0, 1.0), detail);
}

void Progress::Draw(double fraction, const Message& detail) {
  constexpr int kBar = 24;
  const int filled = static_cast<int>(fraction * kBar + 0.5);
  const std::string line = fmt::format("{} [{}{}] {:3.0f} %  {}", LeftAligned(step_, 24),
                                       std::string(static_cast<std::size_t>(filled), '#'),
                                       std::string(static_cast<std::size_t>(kBar - filled), '.'),
                                       100 * fraction, Text(detail, language_));
  fmt::print(stderr, "\r\x1b[K{}",
             FirstCharacters(line, static_cast<std::size_t>(TerminalWidth() - 1)));
  std::fflush(stderr);
  is_drawn_ = true;
}

void Progress::Clear() {
  if (!is_drawn_) return;
  fmt::print(stderr, "\r\x1b[K");
  std::fflush(stderr);
  is_drawn_ = false;
}

}  // namespace plumb
