// Recognising paired displays by their cookies.
#include "web/api/displays.hpp"

#include <gtest/gtest.h>

namespace plumb::web {
namespace {

/// The database of paired displays; empty while it is not open.
class DisplaysInMemory : public DisplayService {
 public:
  std::vector<Display> Displays() override {
    ++reads;
    return displays;
  }
  void AddDisplay(const Actor&, const Display&, Done) override {}
  void RemoveDisplay(const Actor&, const std::string&, Done) override {}

  std::vector<Display> displays;
  int reads = 0;
};

Request WithCookieOf(const std::string& token) {
  Request request;
  request.headers["cookie"] = "plumb_display=" + token;
  return request;
}

TEST(DisplaysTest, IsKnownOnceADatabaseThatOpenedLateCanBeRead) {
  DisplaysInMemory service;
  Displays::TimePoint now{std::chrono::hours(1)};
  Displays displays(service, false, [&] { return now; });
  EXPECT_EQ(displays.SessionOf(WithCookieOf("token")), nullptr);

  service.displays.push_back({.id = "1",
                              .name = "room",
                              .token_hash = StoredHashOf("token"),
                              .paired_at = {},
                              .paired_by = "engineer"});
  now += std::chrono::seconds(5);
  const auto session = displays.SessionOf(WithCookieOf("token"));
  ASSERT_NE(session, nullptr);
  EXPECT_EQ(session->user, "display room");
  EXPECT_EQ(displays.SessionOf(WithCookieOf("another")), nullptr);
}

TEST(DisplaysTest, AStreamOfWrongCookiesDoesNotReadTheDatabaseEachTime) {
  DisplaysInMemory service;
  Displays::TimePoint now{std::chrono::hours(1)};
  Displays displays(service, false, [&] { return now; });
  for (int i = 0; i < 1000; ++i) {
    now += std::chrono::milliseconds(10);
    EXPECT_EQ(displays.SessionOf(WithCookieOf("wrong")), nullptr);
  }
  EXPECT_LE(service.reads, 3);  // at first, and every 5 s
}

}  // namespace
}  // namespace plumb::web
