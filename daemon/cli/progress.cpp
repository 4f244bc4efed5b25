#include "daemon/cli/progress.hpp"

#include <algorithm>
#include <cstdio>

#include <sys/ioctl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "daemon/pipeline/scan_runner.hpp"

namespace plumb {
namespace {

constexpr double kRedraw_s = 0.1;

int TerminalWidth() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

Progress::Progress(bool quiet) : quiet_(quiet), is_terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { Clear(); }

void Progress::Update(std::string_view step, double fraction, std::string_view detail) {
  if (quiet_) return;
  const bool is_new = step != step_;
  step_ = step;
  if (!is_terminal_) {
    if (is_new) fmt::print(stderr, "{}\n", step);
    return;
  }
  const double now_s = SteadySeconds();
  if (!is_new && fraction < 1.0 && last_draw_s_ && now_s - *last_draw_s_ < kRedraw_s) return;
  last_draw_s_ = now_s;
  Draw(std::clamp(fraction, 0.0, 1.0), detail);
}

void Progress::Draw(double fraction, std::string_view detail) {
  constexpr int kBar = 24;
  const int filled = static_cast<int>(fraction * kBar + 0.5);
  std::string line = fmt::format(
      "{:<24} [{}{}] {:3.0f} %  {}", step_, std::string(static_cast<std::size_t>(filled), '#'),
      std::string(static_cast<std::size_t>(kBar - filled), '.'), 100 * fraction, detail);
  line.resize(std::min(line.size(), static_cast<std::size_t>(TerminalWidth() - 1)));
  fmt::print(stderr, "\r\x1b[K{}", line);
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
