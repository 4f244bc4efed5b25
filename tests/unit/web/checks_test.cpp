// SPDX-License-Identifier: Apache-2.0
#include "web/http/checks.hpp"

#include <gtest/gtest.h>

namespace plumb::web {
namespace {

TEST(ChecksTest, CookiesAreFoundByTheirWholeName) {
  EXPECT_EQ(CookieValue("a=1; plumb_session=abc; b=2", "plumb_session"), "abc");
  EXPECT_EQ(CookieValue("xplumb_session=abc", "plumb_session"), std::nullopt);
  EXPECT_EQ(CookieValue("plumb_session=a; plumb_session=b", "plumb_session"), std::nullopt);
  EXPECT_EQ(CookieValue("plumb_session", "plumb_session"), std::nullopt);
}

TEST(ChecksTest, FormsAreUnescapedOnceAndCompletely) {
  const auto form = ParseForm("name=a%2Bb+c&password=%C3%A4%26");
  ASSERT_TRUE(form.has_value());
  EXPECT_EQ(form->at("name"), "a+b c");
  EXPECT_EQ(form->at("password"), "\xC3\xA4&");
  EXPECT_FALSE(ParseForm("name=%2").has_value());
  EXPECT_FALSE(ParseForm("name=%zz").has_value());
  EXPECT_FALSE(ParseForm("name=a&name=b").has_value());
  EXPECT_FALSE(ParseForm("name").has_value());
}

TEST(ChecksTest, OriginMustBeTheRequestsOwnHost) {
  EXPECT_TRUE(IsSameOrigin("http://localhost:80", "LOCALHOST:80", false));
  EXPECT_FALSE(IsSameOrigin("http://localhost:80", "localhost:81", false));
  EXPECT_FALSE(IsSameOrigin("https://localhost:80", "localhost:80", false));
  EXPECT_FALSE(IsSameOrigin("http://localhost", "localhost", true));
  EXPECT_FALSE(IsSameOrigin("null", "null", false));
}

TEST(ChecksTest, GzipIsTakenOnlyWhereAccepted) {
  EXPECT_TRUE(AcceptsGzip(std::nullopt));
  EXPECT_TRUE(AcceptsGzip("deflate, GZIP;q=0.5"));
  EXPECT_TRUE(AcceptsGzip("*"));
  EXPECT_FALSE(AcceptsGzip("identity"));
  EXPECT_FALSE(AcceptsGzip("gzip;q=0"));
  EXPECT_FALSE(AcceptsGzip("*, gzip;q=0.000"));
}

TEST(ChecksTest, NamesLeadNowhere) {
  EXPECT_TRUE(IsName("app.1A2b.js"));
  for (const char* bad : {"", ".", "..", ".hidden", "a/b", "a\\b", "a%2f", "a b", "\xC3\xA4"})
    EXPECT_FALSE(IsName(bad)) << bad;
  EXPECT_FALSE(IsName(std::string(65, 'a')));
}

TEST(ChecksTest, AnIpv6NetworkCountsAsOneAddress) {
  EXPECT_EQ(NetworkOf("2001:db8:1:2:3:4:5:6"), "2001:db8:1:2::");
  EXPECT_EQ(NetworkOf("2001:db8:1:2:ffff::1"), "2001:db8:1:2::");
  EXPECT_EQ(NetworkOf("fe80::1"), "fe80::");
  for (const char* same : {"::1", "::ffff:10.0.0.1", "10.0.0.1", "127.0.0.1", ""})
    EXPECT_EQ(NetworkOf(same), same);
}

TEST(ChecksTest, NamesOfHeadersAreTokens) {
  for (const char* good : {"Host", "X-CSRF-Token", "a!#$%&'*+-.^_`|~9"}) EXPECT_TRUE(IsToken(good));
  for (const char* bad : {"", "Host ", " Host", "a b", "a:b", "a\tb", "\xC3\xA4", "a(b)"})
    EXPECT_FALSE(IsToken(bad)) << bad;
}

TEST(ChecksTest, OneCodingIsTaken) {
  EXPECT_TRUE(IsChunked("chunked"));
  EXPECT_TRUE(IsChunked(" Chunked\t"));
  for (const char* bad : {"", "xchunked", "chunked, identity", "gzip, chunked", "chunked;q=1"})
    EXPECT_FALSE(IsChunked(bad)) << bad;
}

TEST(ChecksTest, HtmlIsEscaped) {
  EXPECT_EQ(EscapeHtml("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
}

}  // namespace
}  // namespace plumb::web
