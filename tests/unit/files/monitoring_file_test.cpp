// SPDX-License-Identifier: Apache-2.0
// The record of live monitoring: what was written is read, a cut end is left out, and what no
// writer wrote is refused.
#include "daemon/monitoring_files/monitoring_file.hpp"

#include <cmath>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class MonitoringFileTest : public ::testing::Test {
 protected:
  MonitoringFileTest() {
    std::filesystem::create_directory(scan_);
    for (int k = 0; k < 1500; ++k) lines_.push_back(LineAt(k));
    MonitoringFileWriter writer(file_, {{"scan", "000007"}, {"judges", "against_reference"}});
    writer.AddEvent({{"event", "zero"}});
    writer.AddFrames(lines_);
    writer.AddEvent({{"event", "ended"}});
    writer.Sync();
  }

  static MonitorLine LineAt(int k) {
    MonitorLine line{
        .time_s = 100.0 + k / 30.0, .sensors_used = 1, .state = MonitorState::kZeroing};
    if (k < 30) return line;
    line.state = MonitorState::kMonitoring;
    line.advice = k < 900 ? LiveAdvice::kIn : LiveAdvice::kOut;
    line.since_zero.emplace();
    line.since_zero->value << 0.001234567, -0.002, 0.0005, 0.001, -0.002, 0.003 * k / 1500;
    line.since_zero->u95.setConstant(0.00030049);
    if (k >= 1000) line.against_reference = line.since_zero;
    line.breathing_m = 0.004 * std::sin(k);
    line.visible = 0.98765;
    line.residual = 1.25;
    line.drift = 1.0002;
    line.markers_seen = 9;
    line.couch_moved = k == 1200;
    return line;
  }

  std::string Bytes() const {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void Replace(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << bytes;
  }

  TempFolder folder_;
  const std::filesystem::path scan_ = folder_ / "000007";
  const std::filesystem::path file_ = scan_ / kMonitoringFolder / MonitoringFileName(1);
  std::vector<MonitorLine> lines_;
};

TEST_F(MonitoringFileTest, GivesBackWhatWasWritten) {
  const StoredMonitoring stored = ReadMonitoringFile(file_);
  EXPECT_FALSE(stored.is_cut_off);
  EXPECT_TRUE(stored.record.has_reference);
  EXPECT_EQ(stored.head.at("scan"), "000007");
  EXPECT_EQ(ReadMonitoringHead(file_), stored.head);
  ASSERT_EQ(stored.events.size(), 2u);
  EXPECT_EQ(stored.events[1].at("event"), "ended");
  ASSERT_EQ(stored.record.lines.size(), lines_.size());
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    const MonitorLine &read = stored.record.lines[k], &wrote = lines_[k];
    EXPECT_EQ(read.time_s, wrote.time_s);
    EXPECT_EQ(read.state, wrote.state);
    EXPECT_EQ(read.advice, wrote.advice);
    EXPECT_EQ(read.couch_moved, wrote.couch_moved);
    ASSERT_EQ(read.since_zero.has_value(), wrote.since_zero.has_value());
    ASSERT_EQ(read.against_reference.has_value(), wrote.against_reference.has_value());
    ASSERT_EQ(read.breathing_m.has_value(), wrote.breathing_m.has_value());
    if (!wrote.since_zero) continue;
    EXPECT_LT((read.since_zero->value - wrote.since_zero->value).cwiseAbs().maxCoeff(), 1e-9);
    // Rounded up, so that no interval becomes narrower.
    EXPECT_GE(read.since_zero->u95.minCoeff(), wrote.since_zero->u95[0] - 1e-12);
    EXPECT_LT(read.since_zero->u95.maxCoeff(), wrote.since_zero->u95[0] + 1.01e-6);
  }
  // The columns of `plumb monitor`.
  const std::string csv = MonitoringCsv(stored.record);
  EXPECT_THAT(csv, HasSubstr("time_s,state,advice,lateral_mm,"));
  EXPECT_THAT(csv, HasSubstr("ref_lateral_mm"));
  EXPECT_THAT(csv, HasSubstr("monitoring,in,1.2346,"));
  EXPECT_THAT(MonitoringFilesOf(scan_), ElementsAre(1));
}

TEST_F(MonitoringFileTest, TheReportCountsTimesAndHolds) {
  const auto report = MonitoringReport(ReadMonitoringFile(file_));
  EXPECT_EQ(report.at("frames"), 1500);
  EXPECT_NEAR(report.at("seconds").get<double>(), 1499 / 30.0, 1e-6);
  EXPECT_NEAR(report.at("states_s").at("zeroing").get<double>(), 1.0, 1e-6);
  EXPECT_NEAR(report.at("advice_s").at("in").get<double>(), 870 / 30.0, 1e-6);
  EXPECT_NEAR(report.at("advice_s").at("out").get<double>(), 599 / 30.0, 1e-6);
  EXPECT_EQ(report.at("holds"), 1);
  EXPECT_NEAR(report.at("drift").at("last").get<double>(), 1.0002, 1e-6);
  EXPECT_NEAR(report.at("since_zero").at("yaw_deg").at("last").get<double>(),
              0.003 * 1499 / 1500 * 180 / M_PI, 1e-4);
  EXPECT_EQ(report.at("events")[0].at("time_s"), 0.0);
}

TEST_F(MonitoringFileTest, ACutEndIsLeftOutAndSaid) {
  const std::string whole = Bytes();
  // As a power cut leaves it: shorter, longer with zeros, or with a last block half written.
  for (const std::size_t lost : {1u, 20u, 5000u}) {
    Replace(whole.substr(0, whole.size() - lost));
    const StoredMonitoring stored = ReadMonitoringFile(file_);
    EXPECT_TRUE(stored.is_cut_off);
    EXPECT_EQ(stored.events.size(), 1u);
    EXPECT_EQ(stored.record.lines.size(), lost < 100 ? 1500u : 1260u) << "630 frames a block";
  }
  Replace(whole + std::string(4096, '\0'));
  EXPECT_EQ(ReadMonitoringFile(file_).record.lines.size(), 1500u);
  EXPECT_TRUE(ReadMonitoringFile(file_).is_cut_off);
  std::string last = whole;
  last[last.size() - 6] ^= 1;
  Replace(last);
  EXPECT_TRUE(ReadMonitoringFile(file_).is_cut_off);
  EXPECT_EQ(ReadMonitoringFile(file_).events.size(), 1u);
}

TEST_F(MonitoringFileTest, AChangedByteBeforeTheEndIsRefused) {
  const std::string whole = Bytes();
  for (std::size_t at = 0; at + 200 < whole.size(); at += 997) {
    std::string changed = whole;
    changed[at] ^= 0x10;
    Replace(changed);
    EXPECT_THROW((void)ReadMonitoringFile(file_), DataError) << at;
  }
}

TEST_F(MonitoringFileTest, WhatNoWriterWroteIsRefused) {
  // Blocks with a right sum and wrong contents, as a person might make them.
  const auto with = [this](const MonitorLine& line) {
    std::filesystem::remove(file_);
    MonitoringFileWriter writer(file_, {{"scan", "000007"}});
    writer.AddFrames(std::vector{line});
    writer.AddEvent({{"event", "ended"}});
    return [this] { return ReadMonitoringFile(file_); };
  };
  EXPECT_EQ(with(LineAt(100))().record.lines.size(), 1u);
  MonitorLine bad = LineAt(100);
  bad.time_s = std::nan("");
  EXPECT_THROW((void)with(bad)(), DataError);
  bad = LineAt(100);
  bad.since_zero->value[3] = 1e9;
  EXPECT_THROW((void)with(bad)(), DataError);
  bad = LineAt(100);
  bad.state = static_cast<MonitorState>(17);
  EXPECT_THROW((void)with(bad)(), DataError);
  bad = LineAt(100);
  bad.reason = static_cast<BlindReason>(200);
  EXPECT_THROW((void)with(bad)(), DataError);

  Replace("");
  EXPECT_THROW((void)ReadMonitoringFile(file_), DataError);
  Replace("PLUMBMON\x02\0\0\0");
  EXPECT_THROW((void)ReadMonitoringFile(file_), DataError);
  std::string huge("PLUMBMON\x01\0\0\0\x01\0\0\0\xff\xff\xff\xff", 20);
  Replace(huge);
  EXPECT_THROW((void)ReadMonitoringFile(file_), DataError);
  EXPECT_THROW((void)ReadMonitoringHead(file_), DataError);
  std::filesystem::remove(file_);
  std::filesystem::create_directory(file_);
  EXPECT_THROW((void)ReadMonitoringFile(file_), DataError);
  EXPECT_THROW((void)ReadMonitoringHead(file_), DataError);
}

TEST_F(MonitoringFileTest, AnOlderRecordIsNeverOverwritten) {
  EXPECT_THROW(MonitoringFileWriter(file_, {{"scan", "000007"}}), IoError);
  EXPECT_EQ(ReadMonitoringFile(file_).record.lines.size(), 1500u);
  // Nor is a scan made again that was removed meanwhile.
  std::filesystem::remove_all(scan_);
  EXPECT_THROW(MonitoringFileWriter(file_, {{"scan", "000007"}}), IoError);
  EXPECT_FALSE(std::filesystem::exists(scan_));
}

TEST_F(MonitoringFileTest, EndsWithinItsBound) {
  MonitoringFileWriter writer(scan_ / kMonitoringFolder / MonitoringFileName(2),
                              {{"scan", "000007"}});
  int seconds = 0;
  while (writer.HasRoom()) {
    writer.AddFrames(std::span(lines_).first(30));
    ++seconds;
  }
  EXPECT_GT(seconds, 2 * 3600) << "two hours of one sensor";
  EXPECT_LE(std::filesystem::file_size(scan_ / kMonitoringFolder / MonitoringFileName(2)),
            kMostMonitoringBytes);
  EXPECT_EQ(
      ReadMonitoringFile(scan_ / kMonitoringFolder / MonitoringFileName(2)).record.lines.size(),
      static_cast<std::size_t>(30 * seconds));
}

}  // namespace
}  // namespace plumb::testing
