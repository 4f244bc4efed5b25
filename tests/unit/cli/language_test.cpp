// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/language.hpp"

#include <cstdlib>
#include <initializer_list>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "words/cli.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

/// The three variables as a test sets them; what they were comes back after it.
class LanguageOfEnvironmentTest : public ::testing::Test {
 protected:
  LanguageOfEnvironmentTest() {
    for (Variable& one : variables_) {
      if (const char* const value = std::getenv(one.name)) one.before = value;
      ::unsetenv(one.name);
    }
  }
  ~LanguageOfEnvironmentTest() override {
    for (const Variable& one : variables_) {
      if (one.before)
        ::setenv(one.name, one.before->c_str(), 1);
      else
        ::unsetenv(one.name);
    }
  }
  static void Set(const char* name, const std::string& value) { ::setenv(name, value.c_str(), 1); }

 private:
  struct Variable {
    const char* name;
    std::optional<std::string> before = {};
  };
  Variable variables_[3] = {{"LC_ALL"}, {"LC_MESSAGES"}, {"LANG"}};
};

TEST_F(LanguageOfEnvironmentTest, EachCatalogueIsFoundByItsLocales) {
  for (const Catalogue* one : Catalogues()) {
    const std::string code(one->code);
    for (const std::string& locale :
         {code, code + "_XX", code + ".UTF-8", code + "_XX.UTF-8", code + "@euro"}) {
      Set("LANG", locale);
      EXPECT_EQ(LanguageOfEnvironment().code, code) << locale;
    }
  }
}

TEST_F(LanguageOfEnvironmentTest, EnglishWhereNothingElseIsKnown) {
  EXPECT_EQ(&LanguageOfEnvironment(), &EnglishCatalogue()) << "nothing is set";
  for (const char* locale : {"", "C", "C.UTF-8", "POSIX", "xx_YY.UTF-8", "_", "e"}) {
    Set("LANG", locale);
    EXPECT_EQ(&LanguageOfEnvironment(), &EnglishCatalogue()) << locale;
  }
}

TEST_F(LanguageOfEnvironmentTest, TheFirstVariableThatIsSetDecides) {
  for (const Catalogue* one : Catalogues()) {
    const std::string code(one->code);
    Set("LANG", code);
    EXPECT_EQ(LanguageOfEnvironment().code, code);
    Set("LC_MESSAGES", "C");
    EXPECT_EQ(&LanguageOfEnvironment(), &EnglishCatalogue());
    Set("LC_ALL", code);
    EXPECT_EQ(LanguageOfEnvironment().code, code);
    Set("LC_ALL", "");
    Set("LC_MESSAGES", "");
    EXPECT_EQ(LanguageOfEnvironment().code, code) << "an empty one counts as not set";
  }
}

TEST(UnknownLanguageTest, ListsEveryLanguage) {
  const std::string text = UnknownLanguage("xx").English();
  EXPECT_THAT(text, HasSubstr("'xx'"));
  for (const Catalogue* one : Catalogues()) {
    EXPECT_THAT(text, HasSubstr(std::string(one->code) + " (" + std::string(one->name) + ")"));
    EXPECT_THAT(LanguageCodes(), HasSubstr(std::string(one->code)));
  }
}

TEST(AlignmentTest, CountsCharactersAndNotBytes) {
  EXPECT_EQ(LeftAligned("größe", 7) + "|", "größe  |");
  EXPECT_EQ(RightAligned("größe", 7), "  größe");
  EXPECT_EQ(LeftAligned("größe", 3), "größe");
  EXPECT_EQ(FirstCharacters("größe", 4), "größ");
  EXPECT_EQ(FirstCharacters("größe", 9), "größe");
  EXPECT_EQ(FirstCharacters("größe", 0), "");
}

}  // namespace
}  // namespace plumb
