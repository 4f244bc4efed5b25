// SPDX-License-Identifier: Apache-2.0
// The socket of the driver "stream": plugging, frames, unplugging, stalls and hostile programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <functional>
#include <mutex>
#include <random>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/unix_socket.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/stream/stream_protocol.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using stream::Header;
using stream::Kind;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

constexpr int kWidth = 40, kHeight = 30, kDepthWidth = 20, kDepthHeight = 15;

json GoodHello() {
  return {{"protocol", "plumb stream"},
          {"version", 1},
          {"serial", "UNIT-1"},
          {"name", "a camera"},
          {"rate_hz", 30},
          {"camera",
           {{"image_width", kWidth},
            {"image_height", kHeight},
            {"camera_matrix", {38, 0, 19.5, 0, 38, 14.5, 0, 0, 1}},
            {"distortion_coefficients", {0, 0, 0, 0, 0}},
            {"depth_scale", 10000},
            {"depth_registered", 0},
            {"depth_image_width", kDepthWidth},
            {"depth_image_height", kDepthHeight},
            {"depth_camera_matrix", {19, 0, 9.5, 0, 19, 7, 0, 0, 1}},
            {"depth_distortion_coefficients", {0, 0, 0, 0, 0}},
            {"T_color_depth", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.002, 0, 0, 0, 1}}}}};
}

/// A program at the other end of the socket.
class Program {
 public:
  explicit Program(const std::filesystem::path& socket) : fd_(ConnectUnix(socket)) {}
  explicit Program(int connected) : fd_(connected) {}
  ~Program() { HangUp(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  void HangUp() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  void Raw(const void* data, std::size_t size) const {
    const auto* from = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t sent = ::send(fd_, from, size, MSG_NOSIGNAL);
      if (sent <= 0) return;  // Plumb has hung up.
      from += sent;
      size -= static_cast<std::size_t>(sent);
    }
  }
  void Send(Kind kind, const std::string& payload, std::int64_t stamp_us = 0) const {
    Header header;
    header.kind = static_cast<std::uint32_t>(kind);
    header.size = payload.size();
    header.stamp_us = stamp_us;
    Raw(&header, sizeof header);
    Raw(payload.data(), payload.size());
  }
  void SendPair(std::int64_t stamp_us) const {
    Send(Kind::kColor, std::string(std::size_t{3} * kWidth * kHeight, '\x07'), stamp_us);
    std::string depth;
    for (int i = 0; i < kDepthWidth * kDepthHeight; ++i) depth += "\x10\x27";  // 10000: 1 m.
    Send(Kind::kDepth, depth, stamp_us + 1000);
  }
  /// What Plumb says until it hangs up.
  [[nodiscard]] std::string Answers() const {
    std::string text;
    char part[256];
    for (ssize_t got = 0; (got = ::recv(fd_, part, sizeof part, 0)) > 0;)
      text.append(part, static_cast<std::size_t>(got));
    return text;
  }
  /// One line.
  [[nodiscard]] json Answer() const {
    std::string line;
    for (char c = 0; ::recv(fd_, &c, 1, 0) == 1 && c != '\n';) line += c;
    return json::parse(line, nullptr, false);
  }

 private:
  int fd_;
};

class StreamTest : public ::testing::Test {
 protected:
  StreamTest() {
    settings_.calibration_folder = folder_ / "calibration";
    settings_.stream_socket = folder_ / "sensor.sock";
    setup_ = BuiltInSensors().Choose("stream", false).set_up(settings_, {}, {}, {});
    provider_ = setup_->MakeProvider();
    provider_->SetListener([this] {
      const std::lock_guard lock(mutex_);
      ++num_changes_;
      changed_.notify_all();
    });
  }
  ~StreamTest() override { provider_.reset(); }

  /// Looks again whenever the provider tells of a change.
  [[nodiscard]] bool Becomes(const std::function<bool()>& holds) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20), holds);
  }
  [[nodiscard]] bool BecomesAttached(bool attached) {
    return Becomes([&] { return provider_->List().empty() != attached; });
  }
  /// What Plumb answers to a program that sends this.
  std::string AnswerTo(const std::function<void(Program&)>& send) {
    Program program(settings_.stream_socket);
    send(program);
    std::string answers = program.Answers();
    EXPECT_TRUE(BecomesAttached(false));
    return answers;
  }

  const TempFolder folder_;
  SensorSettings settings_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int num_changes_ = 0;  ///< Guarded.
  std::unique_ptr<SensorSetup> setup_;
  std::unique_ptr<SensorProvider> provider_;
};

TEST_F(StreamTest, FramesArriveRegisteredAndHangingUpIsAnUnplug) {
  EXPECT_TRUE(provider_->List().empty());
  EXPECT_THROW((void)provider_->Open(""), DeviceError);
  auto program = std::make_unique<Program>(settings_.stream_socket);
  program->Send(Kind::kHello, GoodHello().dump());
  EXPECT_EQ(program->Answer(), json({{"accepted", true}}));
  ASSERT_TRUE(BecomesAttached(true));
  EXPECT_TRUE(Becomes([&] { return num_changes_ == 1; }));
  EXPECT_EQ(provider_->List().front().serial, "UNIT-1");
  EXPECT_EQ(provider_->List().front().name, "a camera");
  const std::unique_ptr<LiveSensor> sensor = OpenSensor(*provider_, "UNIT-1");
  EXPECT_EQ(sensor->info().intrinsics.fx, 38);
  EXPECT_FALSE(sensor->info().intrinsics_assumed);
  program->SendPair(5'000'000);
  const Frame frame = sensor->Next().value();
  EXPECT_NEAR(frame.color_time_s, 5.0, 1e-9);
  EXPECT_NEAR(frame.depth_time_s, 5.001, 1e-9);
  EXPECT_EQ(frame.color_rgb.at<cv::Vec3b>(3, 4), cv::Vec3b(7, 7, 7));
  ASSERT_EQ(frame.depth_m.size(), cv::Size(kWidth, kHeight));
  EXPECT_NEAR(frame.depth_m.at<float>(15, 20), 1.002, 1e-6) << "seen from the colour camera";
  sensor->LockExposure(true);
  EXPECT_EQ(program->Answer(), json({{"lock_exposure", true}}));
  program.reset();
  EXPECT_THROW((void)sensor->Next(), DeviceLost);
  EXPECT_TRUE(BecomesAttached(false));
  Program again(settings_.stream_socket);
  again.Send(Kind::kHello, GoodHello().dump());
  EXPECT_TRUE(BecomesAttached(true));
}

TEST_F(StreamTest, AStallIsAnUnplugAndTheProgramIsTold) {
  const std::string answers = AnswerTo([&](Program& program) {
    program.Send(Kind::kHello, GoodHello().dump());
    ASSERT_TRUE(BecomesAttached(true));
    const auto sensor = provider_->Open("");
    program.SendPair(1000);
    EXPECT_TRUE(sensor->Next());
    Header header;
    header.kind = static_cast<std::uint32_t>(Kind::kColor);
    header.size = std::size_t{3} * kWidth * kHeight;
    program.Raw(&header, sizeof header);  // And not one pixel.
    EXPECT_THROW((void)sensor->Next(), DeviceError);
  });
  EXPECT_THAT(answers, HasSubstr("no complete message"));
}

TEST_F(StreamTest, ASecondProgramIsToldThatOneIsThere) {
  Program first(settings_.stream_socket);
  first.Send(Kind::kHello, GoodHello().dump());
  ASSERT_TRUE(BecomesAttached(true));
  const Program second(settings_.stream_socket);
  EXPECT_THAT(second.Answers(), HasSubstr("another program"));
  EXPECT_FALSE(provider_->List().empty());
}

TEST_F(StreamTest, WrongSizesAndOtherMessagesAreRefusedWithTheReason) {
  const auto after_hello = [&](const std::function<void(Program&)>& send) {
    return AnswerTo([&](Program& program) {
      program.Send(Kind::kHello, GoodHello().dump());
      send(program);
    });
  };
  EXPECT_THAT(after_hello([](Program& p) { p.Send(Kind::kColor, "short", 1); }),
              HasSubstr("has 5 bytes, expected 3600 for 40x30"));
  EXPECT_THAT(after_hello([](Program& p) {
                Header header;  // Of an image that would fill the memory.
                header.kind = 3;
                header.size = ~std::uint64_t{0};
                p.Raw(&header, sizeof header);
              }),
              HasSubstr("expected 600 for 20x15"));
  EXPECT_THAT(after_hello([](Program& p) { p.Send(Kind::kHello, "{}"); }), HasSubstr("no image"));
  EXPECT_THAT(after_hello([](Program& p) { p.Send(Kind::kDepth, std::string(600, 'a'), -1); }),
              HasSubstr("microseconds"));
  EXPECT_THAT(AnswerTo([](Program& p) { p.Send(Kind::kColor, "x"); }), HasSubstr("kind 1"));
  EXPECT_THAT(AnswerTo([](Program& p) { p.Raw("GET / HTTP/1.1\r\nHost: plumb\r\n\r\n", 30); }),
              HasSubstr("PLMB"));
  EXPECT_THAT(AnswerTo([](Program& p) {
                Header header;
                header.kind = 1;
                header.size = std::uint64_t{1} << 40U;
                p.Raw(&header, sizeof header);
              }),
              HasSubstr("longer than"));
}

TEST_F(StreamTest, TheCalibrationOfTheUnitTakesPrecedence) {
  std::filesystem::create_directories(settings_.calibration_folder);
  WriteWholeFile(settings_.calibration_folder / "UNIT-1.yaml",
                 std::string_view("image_width: 40\nimage_height: 30\n"
                                  "camera_matrix: [39, 0, 19, 0, 39, 14, 0, 0, 1]\n"
                                  "distortion_coefficients: [0, 0, 0, 0, 0]\n"));
  Program program(settings_.stream_socket);
  program.Send(Kind::kHello, GoodHello().dump());
  ASSERT_TRUE(BecomesAttached(true));
  EXPECT_EQ(provider_->Open("UNIT-1")->info().intrinsics.fx, 39);
}

TEST_F(StreamTest, TheCalibrationOfTheUnitLeavesTheFeedersDepthCamera) {
  std::filesystem::create_directories(settings_.calibration_folder);
  const std::string file =
      "image_width: 40\nimage_height: 30\ncamera_matrix: [39, 0, 19, 0, 39, 14, 0, 0, 1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\n";
  WriteWholeFile(settings_.calibration_folder / "UNIT-1.yaml", file);
  json hello = GoodHello();
  hello["camera"]["depth_sensor"] = "time_of_flight";
  hello["camera"]["depth_range"] = {0.5, 5.0};
  const Program program(settings_.stream_socket);
  program.Send(Kind::kHello, hello.dump());
  ASSERT_TRUE(BecomesAttached(true));
  const StreamInfo fed = provider_->Open("UNIT-1")->info();
  EXPECT_EQ(fed.intrinsics.fx, 39);
  EXPECT_EQ(fed.depth_sensor, DepthSensor::kTimeOfFlight);
  EXPECT_EQ(fed.depth_noise, ClassOf(DepthSensor::kTimeOfFlight).noise);
  EXPECT_EQ(fed.usable_depth, (UsableDepth{.nearest_m = 0.5, .farthest_m = 5.0}));
  WriteWholeFile(settings_.calibration_folder / "UNIT-1.yaml", file + "depth_sensor: lidar\n");
  const StreamInfo stated = provider_->Open("UNIT-1")->info();
  EXPECT_EQ(stated.depth_sensor, DepthSensor::kLidar);
  EXPECT_EQ(stated.usable_depth, ClassOf(DepthSensor::kLidar).range);
}

/// Takes every descriptor that the process may still have; the next one fails with EMFILE.
class NoFreeDescriptor {
 public:
  NoFreeDescriptor() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int next = ::dup(STDERR_FILENO);
    ::close(next);
    rlimit none = before_;
    none.rlim_cur = static_cast<rlim_t>(next);
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoFreeDescriptor() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoFreeDescriptor(const NoFreeDescriptor&) = delete;
  NoFreeDescriptor& operator=(const NoFreeDescriptor&) = delete;

 private:
  rlimit before_{};
};

double ProcessorTime_s() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

/// Of half a second. Measured: 0.0004 s; of a server that spins, 0.22 s on a machine that had other
/// work.
constexpr double kBusy_s = 0.05;

TEST_F(StreamTest, AProgramThatCannotBeAcceptedWaitsWithoutWork) {
  // The client's socket is made before the last descriptor is gone, and connects afterwards.
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  settings_.stream_socket.string().copy(address.sun_path, sizeof address.sun_path - 1);
  {
    const NoFreeDescriptor none;
    const double before_s = ProcessorTime_s();
    ASSERT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    // It is never attached; a server that spins uses all of this time.
    std::unique_lock lock(mutex_);
    EXPECT_FALSE(changed_.wait_for(lock, std::chrono::milliseconds(500),
                                   [&] { return !provider_->List().empty(); }));
    EXPECT_LT(ProcessorTime_s() - before_s, kBusy_s);
  }
  const Program program(fd);
  program.Send(Kind::kHello, GoodHello().dump());
  EXPECT_TRUE(BecomesAttached(true)) << "accepted at the next try";
}

TEST_F(StreamTest, ASecondProgramThatCannotBeAcceptedDoesNotDisturbTheFirst) {
  const Program first(settings_.stream_socket);
  first.Send(Kind::kHello, GoodHello().dump());
  ASSERT_TRUE(BecomesAttached(true));
  const auto sensor = provider_->Open("");
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  settings_.stream_socket.string().copy(address.sun_path, sizeof address.sun_path - 1);
  const NoFreeDescriptor none;
  ASSERT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const double before_s = ProcessorTime_s();
  for (int pair = 0; pair < 3; ++pair) {
    first.SendPair(1'000'000 + 33'333 * pair);
    EXPECT_TRUE(sensor->Next());
  }
  std::unique_lock lock(mutex_);
  EXPECT_FALSE(changed_.wait_for(lock, std::chrono::milliseconds(500),
                                 [&] { return provider_->List().empty(); }));
  EXPECT_LT(ProcessorTime_s() - before_s, kBusy_s);
  ::close(fd);
}

TEST_F(StreamTest, TheSocketIsNotTakenFromAnotherPlumbd) {
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)setup_->MakeProvider(); }),
              HasSubstr("sensor.sock"));
  provider_.reset();
  EXPECT_FALSE(std::filesystem::exists(settings_.stream_socket));
  provider_ = setup_->MakeProvider();
}

std::string RefusalOf(const std::function<void(json&)>& change) {
  json hello = GoodHello();
  change(hello);
  return MessageOf<DataError>([&] { (void)stream::ParseHello(hello.dump()); });
}

TEST(StreamHelloTest, WhatDoesNotFitIsNamed) {
  EXPECT_THAT(RefusalOf([](json& h) { h["protocol"] = "other"; }), HasSubstr("plumb stream"));
  EXPECT_THAT(RefusalOf([](json& h) { h["version"] = 2; }), HasSubstr("version 2, expected 1"));
  EXPECT_THAT(RefusalOf([](json& h) { h["seriall"] = 1; }), HasSubstr("'serial'"));
  EXPECT_THAT(RefusalOf([](json& h) { h.erase("serial"); }), HasSubstr("serial"));
  EXPECT_THAT(RefusalOf([](json& h) { h["serial"] = "../x\n"; }), HasSubstr("plain"));
  EXPECT_THAT(RefusalOf([](json& h) { h["rate_hz"] = 0; }), HasSubstr("rate_hz"));
  EXPECT_THAT(RefusalOf([](json& h) { h["color_format"] = "yuv"; }), HasSubstr("bgr8"));
  EXPECT_THAT(RefusalOf([](json& h) { h.erase("camera"); }), HasSubstr("camera.yaml"));
  EXPECT_THAT(RefusalOf([](json& h) { h["camera"].erase("depth_scale"); }),
              HasSubstr("depth_scale"));
  EXPECT_THAT(RefusalOf([](json& h) { h["camera"].erase("T_color_depth"); }),
              HasSubstr("T_color_depth"));
  EXPECT_THAT(RefusalOf([](json& h) { h["camera"]["image_width"] = 100000; }), HasSubstr("100000"));
}

TEST(StreamHelloTest, FiveHundredDamagedOnesAreReadOrRefused) {
  std::mt19937 random(5);
  for (int i = 0; i < 500; ++i) {
    std::string text = GoodHello().dump();
    for (int change = 0; change < 1 + i % 4; ++change)
      text[random() % text.size()] = static_cast<char>(random());
    try {
      (void)stream::ParseHello(text);
    } catch (const DataError& error) {
      EXPECT_STRNE(error.what(), "");
    }
  }
}

}  // namespace
}  // namespace plumb
