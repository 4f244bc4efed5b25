#include "algo/acceptance/verdict.hpp"

namespace plumb {

const char* Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return "in_tolerance";
    case Verdict::kUnsure:
      return "unsure";
    case Verdict::kMove:
      return "move";
    case Verdict::kNoAnswer:
      break;
  }
  return "no_answer";
}

}  // namespace plumb
