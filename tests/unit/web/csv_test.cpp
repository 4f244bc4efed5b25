// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/csv.hpp"

#include <gtest/gtest.h>

namespace plumb::web {
namespace {

std::string TableIn(const Catalogue& language) {
  CsvTable table(language);
  table.Plain("code").Plain("vertical_mm").Plain("u95_mm");
  table.EndRow();
  table.Text("=1+1").Number(-8.25).Number(std::nullopt);
  table.EndRow();
  table.Text("a,b;\"c\"").Number(0.00006).Empty();
  table.EndRow();
  return table.Take();
}

TEST(CsvTest, CellsAreAsSpreadsheetsOfTheLanguageReadThem) {
  const std::string commas =
      "\xEF\xBB\xBF"
      "code,vertical_mm,u95_mm\r\n'=1+1,-8.2500,\r\n\"a,b;\"\"c\"\"\",0.0001,\r\n";
  const std::string semicolons =
      "\xEF\xBB\xBF"
      "code;vertical_mm;u95_mm\r\n'=1+1;-8,2500;\r\n\"a,b;\"\"c\"\"\";0,0001;\r\n";
  for (const Catalogue* language : Catalogues())
    EXPECT_EQ(TableIn(*language), language->code == "en" ? commas : semicolons) << language->code;
}

TEST(CsvTest, AFileOfTheCommandLineIsGivenAsSpreadsheetsReadIt) {
  const std::string file = "time_s,shift_mm\r\n0.100,-1.2500\r\n";
  EXPECT_EQ(CsvFor(EnglishCatalogue(), file), "\xEF\xBB\xBF" + file);
  EXPECT_EQ(CsvFor(*FindCatalogue("de"), file),
            "\xEF\xBB\xBF"
            "time_s;shift_mm\r\n0,100;-1,2500\r\n");
}

}  // namespace
}  // namespace plumb::web
