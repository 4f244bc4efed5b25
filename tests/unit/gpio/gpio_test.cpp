// SPDX-License-Identifier: Apache-2.0
// libgpiod itself on an emulated chip (umockdev).
#include "drivers/gpio/gpio.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <sys/stat.h>
#include <umockdev.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/under_umockdev.hpp"

namespace plumb {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using testing::MessageOf;
using Clock = Button::Clock;

/// A chip of 8 lines: 3 is the button, 5 to 7 are lights. libumockdev answers its ioctls on a
/// separate thread.
class FakeChip {
 public:
  FakeChip() : testbed_(umockdev_testbed_new()), handler_(umockdev_ioctl_base_new()) {
    GError* error = nullptr;
    const char* devices =
        "P: /devices/platform/plumb/gpiochip0\nN: gpiochip0\nE: DEVNAME=/dev/gpiochip0\nE: "
        "SUBSYSTEM=gpio\nE: MAJOR=254\nE: MINOR=0\n"
        "A: dev=254:0\\n\n\n"
        "P: /devices/virtual/misc/plumbout\nN: plumbout\nE: DEVNAME=/dev/plumbout\nE: "
        "SUBSYSTEM=misc\nE: MAJOR=10\nE: MINOR=99\n"
        "A: dev=10:99\\n\n\n"
        "P: /devices/virtual/misc/plumbin\nN: plumbin\nE: DEVNAME=/dev/plumbin\nE: "
        "SUBSYSTEM=misc\nE: MAJOR=10\nE: MINOR=98\n"
        "A: dev=10:98\\n\n";
    EXPECT_TRUE(umockdev_testbed_add_from_string(testbed_, devices, &error))
        << (error ? error->message : "");
    g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&FakeChip::OnIoctl), this);
    for (const char* device : {"/dev/gpiochip0", "/dev/plumbout", kEvents})
      EXPECT_TRUE(umockdev_testbed_attach_ioctl(testbed_, device, handler_, &error))
          << (error ? error->message : "");
    // Edges come through a pipe that is a device too, so that the line can be asked for its level.
    gchar* root = umockdev_testbed_get_root_dir(testbed_);
    const std::string node = root + std::string(kEvents);
    g_free(root);
    ::unlink(node.c_str());
    EXPECT_EQ(::mkfifo(node.c_str(), 0600), 0);
    events_ = ::open(kEvents, O_RDWR | O_CLOEXEC);
    EXPECT_GE(events_, 0);
  }
  ~FakeChip() {
    g_object_unref(testbed_);
    g_object_unref(handler_);
    ::close(events_);
  }
  FakeChip(const FakeChip&) = delete;
  FakeChip& operator=(const FakeChip&) = delete;

  /// By default with a stamp of a clock that is not ours, as kernels before 5.7 give it.
  void Edge(bool pressed,
            Clock::time_point at = Clock::time_point(std::chrono::hours(24 * 365 * 50))) {
    held = pressed;
    gpioevent_data event{};
    event.timestamp =
        static_cast<std::uint64_t>(std::chrono::nanoseconds(at.time_since_epoch()).count());
    event.id = pressed ? GPIOEVENT_EVENT_RISING_EDGE : GPIOEVENT_EVENT_FALLING_EDGE;
    EXPECT_EQ(::write(events_, &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }
  std::atomic<bool> held{false};
  std::atomic<unsigned> event_flags{0};
  std::array<std::atomic<int>, 8> outputs{};

 private:
  static const char* NameOf(unsigned line) {
    static constexpr std::array<const char*, 8> kNames{"", "",        "",          "start-button",
                                                       "", "led-red", "led-green", "beeper"};
    return line < kNames.size() ? kNames[line] : "";
  }

  static gboolean OnIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
    return static_cast<FakeChip*>(self)->Answer(client);
  }

  gboolean Answer(UMockdevIoctlClient* client) {
    const gulong request = umockdev_ioctl_client_get_request(client);
    GError* error = nullptr;
    UMockdevIoctlData* data = umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0,
                                                          _IOC_SIZE(request), &error);
    if (data == nullptr) return FALSE;
    gint length = 0;
    guint8* bytes = nullptr;
    umockdev_ioctl_data_retrieve(data, &bytes, &length);
    std::vector<guint8> buffer(bytes, bytes + length);
    g_free(bytes);
    const bool known = Fill(request, buffer.data());
    umockdev_ioctl_data_update(data, 0, buffer.data(), length);
    umockdev_ioctl_client_complete(client, known ? 0 : -1, known ? 0 : ENOTTY);
    g_object_unref(data);
    return TRUE;
  }

  bool Fill(gulong request, void* memory) {
    switch (request) {
      case GPIO_GET_CHIPINFO_IOCTL: {
        auto& info = *static_cast<gpiochip_info*>(memory);
        info = {};
        std::strcpy(info.name, "gpiochip0");
        std::strcpy(info.label, "plumb-test");
        info.lines = 8;
        return true;
      }
      case GPIO_GET_LINEINFO_IOCTL: {
        auto& info = *static_cast<gpioline_info*>(memory);
        const unsigned line = info.line_offset;
        info = {};
        info.line_offset = line;
        std::strcpy(info.name, NameOf(line));
        return true;
      }
      case GPIO_GET_LINEEVENT_IOCTL: {
        auto& wanted = *static_cast<gpioevent_request*>(memory);
        event_flags = wanted.handleflags;
        wanted.fd = ::open(kEvents, O_RDWR | O_CLOEXEC);
        return true;
      }
      case GPIO_GET_LINEHANDLE_IOCTL: {
        auto& wanted = *static_cast<gpiohandle_request*>(memory);
        last_line_ = wanted.lineoffsets[0];
        outputs[last_line_] = wanted.default_values[0];
        wanted.fd = ::open("/dev/plumbout", O_RDWR | O_CLOEXEC);
        return true;
      }
      case GPIOHANDLE_SET_LINE_VALUES_IOCTL:
        outputs[last_line_] = static_cast<gpiohandle_data*>(memory)->values[0];
        return true;
      case GPIOHANDLE_GET_LINE_VALUES_IOCTL:
        static_cast<gpiohandle_data*>(memory)->values[0] = held ? 1 : 0;
        return true;
      default:
        return false;
    }
  }

  static constexpr const char* kEvents = "/dev/plumbin";

  UMockdevTestbed* testbed_;
  UMockdevIoctlBase* handler_;
  int events_ = -1;
  unsigned last_line_ = 0;
};

class GpioTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::UnderUmockdev())
      PLUMB_SKIP("not under umockdev: run it through ctest, or with umockdev-wrapper");
    chip_ = std::make_unique<FakeChip>();
  }
  std::unique_ptr<FakeChip> chip_;
};

bool IsReadable(int fd) {
  pollfd wait{fd, POLLIN, 0};
  return ::poll(&wait, 1, 5000) == 1;
}

TEST_F(GpioTest, APressOnTheLineIsAPress) {
  GpioButton button({.where = {"gpiochip0", "start-button"}});
  EXPECT_NE(chip_->event_flags & GPIOHANDLE_REQUEST_ACTIVE_LOW, 0U);
  std::vector<ButtonPress> presses;
  button.SetListener([&](ButtonPress press) { presses.push_back(press); });
  const Clock::time_point now = Clock::now() + milliseconds(100);
  chip_->Edge(true);
  ASSERT_TRUE(IsReadable(button.fd()));
  button.Dispatch(now);
  ASSERT_TRUE(button.deadline());
  button.Dispatch(*button.deadline());
  chip_->Edge(false);
  ASSERT_TRUE(IsReadable(button.fd()));
  button.Dispatch(now + milliseconds(200));
  EXPECT_TRUE(presses.empty());
  button.Dispatch(now + milliseconds(300));
  EXPECT_EQ(presses, std::vector{ButtonPress::kShort});
  EXPECT_FALSE(button.deadline());
}

TEST_F(GpioTest, APressAndItsReleaseThatAreReadTogetherAreAPress) {
  GpioButton button({.where = {"gpiochip0", "start-button"}});
  std::vector<ButtonPress> presses;
  button.SetListener([&](ButtonPress press) { presses.push_back(press); });
  const Clock::time_point now = Clock::now();
  chip_->Edge(true, now + milliseconds(100));
  chip_->Edge(false, now + milliseconds(300));
  ASSERT_TRUE(IsReadable(button.fd()));
  button.Dispatch(now + milliseconds(400));
  EXPECT_EQ(presses, std::vector{ButtonPress::kShort});
}

TEST_F(GpioTest, AReleaseWhoseEdgeTheKernelHadNoRoomForIsSeenOnTheLine) {
  GpioButton button({.where = {"gpiochip0", "start-button"}});
  std::vector<ButtonPress> presses;
  button.SetListener([&](ButtonPress press) { presses.push_back(press); });
  const Clock::time_point now = Clock::now();
  chip_->Edge(true, now + milliseconds(100));
  chip_->held = false;
  ASSERT_TRUE(IsReadable(button.fd()));
  button.Dispatch(now + milliseconds(300));
  ASSERT_TRUE(button.deadline());
  button.Dispatch(*button.deadline());
  button.Dispatch(now + std::chrono::seconds(10));
  EXPECT_EQ(presses, std::vector{ButtonPress::kShort});
}

TEST_F(GpioTest, AButtonHeldAtTheStartIsNoPress) {
  chip_->held = true;
  GpioButton button({.where = {"gpiochip0", "start-button"}});
  EXPECT_FALSE(button.deadline());
  button.SetListener([](ButtonPress) { ADD_FAILURE() << "no press"; });
  button.Dispatch(Clock::now() + std::chrono::seconds(10));
}

TEST_F(GpioTest, ChipsAndLinesThatAreNotThereAreNamed) {
  EXPECT_THAT(MessageOf<DeviceError>([] {
                GpioButton button({.where = {"gpiochip7", "start-button"}});
              }),
              HasSubstr("gpiochip7"));
  EXPECT_THAT(MessageOf<DeviceError>([] {
                GpioButton button({.where = {"gpiochip0", "stop-button"}});
              }),
              HasSubstr("stop-button"));
}

TEST_F(GpioTest, ALightOfOneLineShowsEveryColour) {
  {
    GpioIndicator indicator(
        {.chip = "gpiochip0", .lights = {"led-red", "", ""}, .beeper = "", .active_low = false});
    indicator.Show(IndicatorPattern::kReady);  // green
    EXPECT_EQ(chip_->outputs[5], 1);
    EXPECT_FALSE(indicator.deadline());
    indicator.Show(IndicatorPattern::kWorking);
    EXPECT_EQ(chip_->outputs[5], 1);
    ASSERT_TRUE(indicator.deadline());
    indicator.Dispatch(*indicator.deadline());
    EXPECT_EQ(chip_->outputs[5], 0);
    indicator.Dispatch(*indicator.deadline());
    EXPECT_EQ(chip_->outputs[5], 1);
  }
  EXPECT_EQ(chip_->outputs[5], 0);  // off at the end
}

TEST_F(GpioTest, TheGatePulsesOnlyWhileItIsToldInAgainAndAgain) {
  using std::chrono::milliseconds;
  std::vector<int> rises_ms;
  {
    GpioGate gate({.where = {"gpiochip0", "led-red"}});
    EXPECT_EQ(chip_->outputs[5], 0) << "a steady level is hold";
    int level = 0;
    const Clock::time_point start{};
    const auto look = [&](int ms) {
      if (chip_->outputs[5] == 1 && level == 0) rises_ms.push_back(ms);
      level = chip_->outputs[5];
    };
    // Ten groups of frames a second: `in` for a second, then out, then silence.
    for (int ms = 0; ms < 3000; ms += 10) {
      const Clock::time_point now = start + milliseconds(ms);
      if (ms < 2000 && ms % 100 == 0) gate.Judge(ms < 1000, now);
      if (gate.deadline() && now >= *gate.deadline()) gate.Dispatch(now);
      look(ms);
    }
    ASSERT_EQ(rises_ms.size(), 10U);
    for (std::size_t i = 1; i < rises_ms.size(); ++i) EXPECT_EQ(rises_ms[i] - rises_ms[i - 1], 100);
    EXPECT_EQ(level, 0);

    // A loop that stalls in the middle of a pulse leaves a steady level: hold as well.
    gate.Judge(true, start + milliseconds(5000));
    EXPECT_EQ(chip_->outputs[5], 1);
    gate.Judge(false, start + milliseconds(5010));
    EXPECT_EQ(chip_->outputs[5], 0) << "out ends a pulse at once";
    gate.Judge(true, start + milliseconds(5100));
  }
  EXPECT_EQ(chip_->outputs[5], 0);  // low at the end
}

TEST_F(GpioTest, ListsChipsWithTheirNamedLines) {
  const std::vector<GpioChipDescription> chips = ListGpioChips();
  ASSERT_EQ(chips.size(), 1U);
  EXPECT_EQ(chips[0].label, "plumb-test");
  EXPECT_THAT(chips[0].lines,
              ::testing::ElementsAre("start-button", "led-red", "led-green", "beeper"));
}

}  // namespace
}  // namespace plumb
