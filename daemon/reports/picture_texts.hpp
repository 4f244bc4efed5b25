// SPDX-License-Identifier: Apache-2.0
// The texts of a report's pictures, from a catalogue.
#pragma once

#include <string>

#include "algo/base/message.hpp"
#include "algo/render/picture_words.hpp"
#include "daemon/files/map_marks.hpp"

namespace plumb {

/// Keeps the texts that the words of pictures point to. The catalogue must outlive it.
class PictureTexts {
 public:
  explicit PictureTexts(const Catalogue& language);
  PictureTexts(const PictureTexts&) = delete;
  PictureTexts& operator=(const PictureTexts&) = delete;

  [[nodiscard]] const PictureWords& words() const { return words_; }

 private:
  std::string both_within_;
  PictureWords words_;
};

/// The words point into the catalogue.
[[nodiscard]] SideWords SideWordsIn(const Catalogue& language);

}  // namespace plumb
