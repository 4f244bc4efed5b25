// SPDX-License-Identifier: Apache-2.0
// A library to be loaded before libgpiod (version 1): button and lights of the unmodified program
// are files in the folder PLUMB_FAKE_GPIO. `button` is a FIFO of edges, '1' pressed, '0' released,
// 'x' the line is gone, 's' the call does not return until the FIFO `stall` is opened for writing;
// `held` exists: it is pressed at the start. `lights` gets a line for each level that is set:
// milliseconds of the steady clock, name of the line, 0 or 1.
#include <fcntl.h>
#include <gpiod.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

struct gpiod_line {
  std::string name;
  int button = -1;
  bool is_pressed = false;  // the state after the edges read so far
};
struct gpiod_chip {
  std::vector<std::unique_ptr<gpiod_line>> lines;  // the chip's, as in libgpiod: gone with it
};

namespace {

std::string InFolder(const char* file) {
  const char* folder = std::getenv("PLUMB_FAKE_GPIO");
  return std::string(folder != nullptr ? folder : "/nonexistent") + "/" + file;
}

void WriteLevel(const gpiod_line& line, int value) {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  char text[128];
  const int size =
      std::snprintf(text, sizeof text, "%lld %s %d\n",
                    static_cast<long long>(now.tv_sec) * 1000 + now.tv_nsec / 1'000'000,
                    line.name.c_str(), value);
  const int fd =
      ::open(InFolder("lights").c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) return;
  (void)!::write(fd, text, static_cast<std::size_t>(size));
  ::close(fd);
}

}  // namespace

#define PLUMB_FAKE extern "C" __attribute__((visibility("default")))

PLUMB_FAKE gpiod_chip* gpiod_chip_open_lookup(const char* name) {
  if (std::string(name) == "gpiochip0") return new gpiod_chip;
  errno = ENOENT;
  return nullptr;
}

PLUMB_FAKE void gpiod_chip_close(gpiod_chip* chip) { delete chip; }

PLUMB_FAKE gpiod_line* gpiod_chip_find_line(gpiod_chip* chip, const char* name) {
  return chip->lines.emplace_back(new gpiod_line{name}).get();
}

PLUMB_FAKE int gpiod_line_request(gpiod_line* line, const gpiod_line_request_config*, int) {
  line->button = ::open(InFolder("button").c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  line->is_pressed = ::access(InFolder("held").c_str(), F_OK) == 0;
  return line->button < 0 ? -1 : 0;
}

PLUMB_FAKE int gpiod_line_request_output_flags(gpiod_line* line, const char*, int, int value) {
  WriteLevel(*line, value);
  return 0;
}

PLUMB_FAKE int gpiod_line_get_value(gpiod_line* line) { return line->is_pressed ? 1 : 0; }

PLUMB_FAKE int gpiod_line_set_value(gpiod_line* line, int value) {
  WriteLevel(*line, value);
  return 0;
}

PLUMB_FAKE int gpiod_line_event_get_fd(gpiod_line* line) { return line->button; }

PLUMB_FAKE int gpiod_line_event_read(gpiod_line* line, gpiod_line_event* event) {
  char edge = 0;
  if (::read(line->button, &edge, 1) != 1 || edge == 'x') return -1;
  if (edge == 's') ::close(::open(InFolder("stall").c_str(), O_RDONLY | O_CLOEXEC));
  ::clock_gettime(CLOCK_MONOTONIC, &event->ts);
  line->is_pressed = edge == '1';
  event->event_type =
      line->is_pressed ? GPIOD_LINE_EVENT_RISING_EDGE : GPIOD_LINE_EVENT_FALLING_EDGE;
  return 0;
}
