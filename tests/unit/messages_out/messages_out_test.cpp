// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/messages_out.hpp"

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fake_peer.hpp"
#include "words/messages.hpp"

namespace plumb {
namespace {

using testing::FakePeer;
using testing::PeerConnection;

/// A webhook that refuses at first, and what a unit does about it.
class MessagesOutTest : public ::testing::Test {
 protected:
  MessagesOutTest() {
    settings_.webhook = fmt::format("http://127.0.0.1:{}/", server_.port());
    waiting_.daily_check = DailyCheck::kPassed;
    waiting_.state = ApplianceState::kReady;
    waiting_.waiting = {
        {.reference_id = "r1", .patient_id = "p1", .patient_code = "c", .planned_by = {}}};
  }

  void Make(RetryPauses pauses) {
    messages_ = std::make_unique<MessagesOut>(
        loop_, settings_, OccasionRules{}, [this] { Changed(); }, std::move(pauses));
  }

  /// Runs the loop until `done_` holds of the way's status.
  MessageWay RunUntil(std::function<bool(const MessageWay&)> done) {
    done_ = std::move(done);
    auto patience = loop_.MakeTimer("patience", [this] { loop_.Quit(1); });
    patience.ArmAfter(std::chrono::seconds(60));
    EXPECT_EQ(loop_.Run(), 0) << "in vain";
    return messages_->status().at(0);
  }

  void Changed() {
    if (done_ && done_(messages_->status().at(0))) loop_.Quit(0);
  }

  std::atomic<int> refusals_ = 0, asked_ = 0;
  FakePeer server_{[this](PeerConnection& client) {
    const std::string head = client.ReadTo("\r\n\r\n");
    const std::size_t length = head.find("Content-Length: ");
    if (length != std::string::npos) (void)client.ReadBytes(std::stoul(head.substr(length + 16)));
    ++asked_;
    client.Write(refusals_-- > 0 ? "HTTP/1.1 503 No\r\nContent-Length: 0\r\n\r\n"
                                 : "HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n");
  }};
  MessagesSettings settings_;
  Status waiting_;
  EventLoop loop_;
  std::function<bool(const MessageWay&)> done_;
  std::unique_ptr<MessagesOut> messages_;
};

TEST_F(MessagesOutTest, AnEventIsSentOnceHoweverOftenOneLooks) {
  Make({});
  for (int i = 0; i < 5; ++i) messages_->Look(waiting_);
  EXPECT_EQ(RunUntil([](const MessageWay& way) { return way.sent == 1; }).waiting, 0);
  EXPECT_EQ(asked_, 1);
}

TEST_F(MessagesOutTest, ARefusalIsSaidAndTriedAgainUntilItIsTaken) {
  refusals_ = 2;
  Make(RetryPauses(3, std::chrono::milliseconds(1)));
  messages_->Look(waiting_);
  const MessageWay refused = RunUntil([](const MessageWay& way) { return !way.failure.empty(); });
  EXPECT_EQ(refused.failure, say::messages::NotDelivered(say::messages::Webhook(), "HTTP 503"));
}

TEST_F(MessagesOutTest, AfterRefusalsItIsTakenAndNothingIsSaidAnyMore) {
  refusals_ = 2;
  Make(RetryPauses(3, std::chrono::milliseconds(1)));
  messages_->Look(waiting_);
  const MessageWay taken = RunUntil([](const MessageWay& way) { return way.sent == 1; });
  EXPECT_TRUE(taken.failure.empty());
  EXPECT_EQ(taken.failed, 0);
  EXPECT_EQ(asked_, 3);
}

TEST_F(MessagesOutTest, ItIsGivenUpAfterTheLastPause) {
  refusals_ = 1000;
  Make(RetryPauses(2, std::chrono::milliseconds(1)));
  messages_->Look(waiting_);
  const MessageWay given_up = RunUntil([](const MessageWay& way) { return way.failed == 1; });
  EXPECT_EQ(given_up.waiting, 0);
  EXPECT_EQ(asked_, 3);
}

TEST_F(MessagesOutTest, WhatNobodyTookIsToldAgainAfterAnHourIfItLasts) {
  refusals_ = 1;
  Make({});
  const auto begin = std::chrono::steady_clock::now();
  messages_->Look(waiting_, begin);
  bool is_given_up = false;
  (void)RunUntil([&](const MessageWay& way) {
    if (way.failed == 1 && !std::exchange(is_given_up, true)) {
      messages_->Look(waiting_, begin + std::chrono::minutes(59));
      EXPECT_EQ(messages_->status().at(0).waiting, 0);
      messages_->Look(waiting_, begin + std::chrono::minutes(60));
    }
    return way.sent == 1;
  });
  EXPECT_EQ(asked_, 2);
}

TEST_F(MessagesOutTest, ATestSaysWhatBecameOfIt) {
  refusals_ = 1;
  Make({std::chrono::hours(1)});
  std::vector<Message> said;
  messages_->Test([&](const Message& failure) {
    said.push_back(failure);
    messages_->Test([&](const Message& second) { said.push_back(second); });
  });
  (void)RunUntil([&](const MessageWay&) { return said.size() == 2; });
  EXPECT_EQ(said[0], say::messages::NotDelivered(say::messages::Webhook(), "HTTP 503"));
  EXPECT_TRUE(said[1].empty());
}

TEST_F(MessagesOutTest, WithoutAWayATestIsRefused) {
  settings_ = {};
  Make({});
  Message said;
  messages_->Test([&](const Message& failure) { said = failure; });
  EXPECT_EQ(said, say::messages::NoWay());
  EXPECT_FALSE(messages_->IsSetUp());
}

TEST_F(MessagesOutTest, TheQueueIsBoundedAndTheEndDoesNotWaitForIt) {
  FakePeer silent([](PeerConnection& client) { (void)client.ReadTo("never"); });
  settings_.webhook = fmt::format("http://127.0.0.1:{}/", silent.port());
  Make({});
  for (std::size_t i = 0; i < Courier::kMostWaiting + 5; ++i) messages_->Test([](const auto&) {});
  const MessageWay way = messages_->status().at(0);
  EXPECT_LE(way.waiting, static_cast<std::int64_t>(Courier::kMostWaiting));
  EXPECT_GE(way.failed, 4) << "one may be on its way";
  const auto begin = std::chrono::steady_clock::now();
  messages_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
}

}  // namespace
}  // namespace plumb
