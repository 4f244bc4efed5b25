// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/picture_texts.hpp"

#include "words/result.hpp"

namespace plumb {
namespace {

/// A text without arguments, where the catalogue stores it.
std::string_view StoredText(MessageId id, const Catalogue& language) {
  return language.TextOf(id.name).value_or(id.name);
}

}  // namespace

PictureTexts::PictureTexts(const Catalogue& language)
    // The drawing fills in the number.
    : both_within_(Text(say::result::PictureBothWithin("{}"), language)) {
  const auto said = [&](MessageId id) { return StoredText(id, language); };
  words_.notice = said(say::result::kNotice);
  words_.x_axis = said(say::result::kPictureXAxis);
  words_.y_axis = said(say::result::kPictureYAxis);
  words_.error_title = said(say::result::kPictureErrorTitle);
  words_.overlay_title = said(say::result::kPictureOverlayTitle);
  words_.height_title = said(say::result::kPictureHeightTitle);
  words_.error = said(say::result::kPictureError);
  words_.absolute_error = said(say::result::kPictureAbsoluteError);
  words_.millimetres = said(say::result::kPictureMillimetres);
  words_.centimetres = said(say::result::kPictureCentimetres);
  words_.higher = said(say::result::kPictureHigher);
  words_.lower = said(say::result::kPictureLower);
  words_.tolerance = said(say::result::kPictureTolerance);
  words_.not_in_both = said(say::result::kPictureNotInBoth);
  words_.not_in_either = said(say::result::kPictureNotInEither);
  words_.not_measured = said(say::result::kPictureNotMeasured);
  words_.hole = said(say::result::kPictureHole);
  words_.outlined = said(say::result::kPictureOutlined);
  words_.surface_on_top = said(say::result::kPictureSurfaceOnTop);
  words_.reference = said(say::result::kPictureReference);
  words_.current = said(say::result::kPictureCurrent);
  words_.height = said(say::result::kPictureHeight);
  words_.isocentre = said(say::result::kPictureIsocentre);
  words_.both_within = both_within_;
  words_.decimal = language.decimal;
}

SideWords SideWordsIn(const Catalogue& language) {
  const auto said = [&](MessageId id) { return StoredText(id, language); };
  return {.head = said(say::result::kSideHead),
          .feet = said(say::result::kSideFeet),
          .left = said(say::result::kSideLeft),
          .right = said(say::result::kSideRight),
          .gantry = said(say::result::kSideGantry)};
}

}  // namespace plumb
