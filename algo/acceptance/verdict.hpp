// The verdict on a comparison, in one word.
#pragma once

#include <cstdint>

namespace plumb {

enum class Verdict : std::uint8_t {
  kInTolerance,  ///< Every value plus its uncertainty lies within its tolerance.
  kUnsure,    ///< Every value lies within its tolerance, but not every value plus its uncertainty.
  kMove,      ///< A value lies outside its tolerance.
  kNoAnswer,  ///< A gate refused: the numbers, if any, must not be acted on.
};

/// "in_tolerance", "unsure", "move", "no_answer".
[[nodiscard]] const char* Name(Verdict verdict);

}  // namespace plumb
