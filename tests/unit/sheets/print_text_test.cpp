// SPDX-License-Identifier: Apache-2.0
#include "daemon/sheets/print_text.hpp"

#include <cairo.h>
#include <gtest/gtest.h>
#include <pango/pangocairo.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

namespace plumb {
namespace {

constexpr double kX = 10.0, kWide = 120.0;

struct Ink {
  double left = 0.0, top = 0.0, width = 0.0, height = 0.0;
};

/// Of what was drawn on a page without edges.
Ink InkOf(const std::function<void(const PrintText&)>& draw) {
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_recording_surface_create(CAIRO_CONTENT_COLOR_ALPHA, nullptr), &cairo_surface_destroy);
  const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cairo(cairo_create(surface.get()),
                                                                 &cairo_destroy);
  draw(PrintText(cairo.get()));
  EXPECT_EQ(cairo_status(cairo.get()), CAIRO_STATUS_SUCCESS);
  Ink ink;
  cairo_recording_surface_ink_extents(surface.get(), &ink.left, &ink.top, &ink.width, &ink.height);
  return ink;
}

int MissingGlyphs(const std::string& text) {
  const std::unique_ptr<PangoContext, decltype(&g_object_unref)> context(
      pango_font_map_create_context(pango_cairo_font_map_get_default()), &g_object_unref);
  const std::unique_ptr<PangoLayout, decltype(&g_object_unref)> layout(
      pango_layout_new(context.get()), &g_object_unref);
  const std::unique_ptr<PangoFontDescription, decltype(&pango_font_description_free)> font(
      pango_font_description_from_string(kPrintFamily), &pango_font_description_free);
  pango_layout_set_font_description(layout.get(), font.get());
  pango_layout_set_text(layout.get(), text.c_str(), -1);
  return pango_layout_get_unknown_glyphs_count(layout.get());
}

const std::string kLong(64, 'W');
const std::string kNames[] = {"张伟医生",
                              "山田 太郎",
                              "김철수",
                              "محمد الأحمد",
                              "Ünal Şahin",
                              "Иван Петров",
                              "Ward 😀",
                              kLong,
                              "一二三四五六七八九十一二三四五六七八九十",
                              "P-0042",
                              "a\tb\nc",
                              "sen\xF1"
                              "al"};

TEST(PrintTextTest, NamesOfEachScriptHaveTheirLetters) {
  for (const std::string& name : kNames)
    if (name.find('\xF1') == std::string::npos) {
      EXPECT_EQ(MissingGlyphs(name), 0) << name;
    }
  EXPECT_GT(MissingGlyphs("\U000F1234"), 0) << "of private use: no font has it";
}

TEST(PrintTextTest, ALineIsNoWiderThanItsPlace) {
  for (const std::string& name : kNames) {
    const Ink ink = InkOf([&](const PrintText& text) {
      text.Line(kX, 50, name, {.size = 9}, kWide);
      EXPECT_GT(text.Width(name, {.size = 9}), 10) << name;
    });
    EXPECT_GT(ink.width, 10) << name;
    EXPECT_GE(ink.left, kX - 1.5) << name;
    EXPECT_LE(ink.left + ink.width, kX + kWide + 1.5) << name;
    EXPECT_LT(ink.height, 2 * 9) << name << ": one line";
  }
}

/// The columns of a picture of the line that have ink.
std::vector<bool> ColumnsOf(const std::string& line) {
  constexpr int kWidth = 400, kHeight = 40;
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_A8, kWidth, kHeight), &cairo_surface_destroy);
  const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cairo(cairo_create(surface.get()),
                                                                 &cairo_destroy);
  PrintText(cairo.get()).Line(kX, 25, line, {.size = 18}, kWidth);
  cairo_surface_flush(surface.get());
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  std::vector<bool> columns(kWidth);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      columns[static_cast<std::size_t>(x)] =
          columns[static_cast<std::size_t>(x)] || data[y * stride + x] > 64;
  return columns;
}

TEST(PrintTextTest, ADateBehindAnArabicNameIsNotTurnedAround) {
  for (const std::string name : {"Mohamed", "محمد الأحمد", "דוד"}) {
    const std::vector<bool> whole = ColumnsOf(name + ", 2026-11-29"),
                            begun = ColumnsOf(name + ", 2026");
    // The line begins with all of the shorter one: what is added stands to its right.
    const auto last = std::find(begun.rbegin(), begun.rend(), true);
    const auto length = static_cast<std::size_t>(begun.rend() - last);
    ASSERT_GT(length, 50U) << name;
    EXPECT_TRUE(std::equal(begun.begin(), begun.begin() + static_cast<std::ptrdiff_t>(length),
                           whole.begin()))
        << name;
    EXPECT_NE(std::find(whole.begin() + static_cast<std::ptrdiff_t>(length) + 5, whole.end(), true),
              whole.end())
        << name;
  }
}

TEST(PrintTextTest, AParagraphBreaksWithinWordsThatAreTooLong) {
  for (const std::string& name : {kLong, kNames[8], kLong + " " + kLong, "short words " + kLong}) {
    int lines = 0;
    const Ink ink = InkOf([&](const PrintText& text) {
      lines = text.Paragraph(kX, 50, 12, kWide, name, {.size = 9, .is_bold = true});
    });
    EXPECT_GT(lines, 1) << name;
    EXPECT_GE(ink.left, kX - 1.5) << name;
    EXPECT_LE(ink.left + ink.width, kX + kWide + 1.5) << name;
    EXPECT_LE(ink.top + ink.height, 50 + 12 * (lines - 1) + 9) << name;
  }
  InkOf([](const PrintText& text) {
    EXPECT_EQ(text.Paragraph(kX, 50, 12, kWide, "", {}), 0);
    EXPECT_EQ(text.Paragraph(kX, 50, 12, kWide, "one line", {}), 1);
  });
}

}  // namespace
}  // namespace plumb
