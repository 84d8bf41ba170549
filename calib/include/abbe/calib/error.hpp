#pragma once
/// Errors of the mathematics are values: what was tried, and what was seen instead, in numbers.

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace abbe::calib {

enum class ErrorCode {
  BadInput,            ///< an argument breaks its documented contract (shape, order, range, syntax)
  NotFinite,           ///< NaN or infinity in the input
  TooFewObservations,  ///< not enough data for the question
  DegenerateGeometry,  ///< the geometry cannot answer: collinear, coincident, flat
  AlignmentFailed,     ///< the measured points do not fit the given path
  RankDeficient,       ///< some parameter is not determined by the data
  NotConverged,        ///< an iteration used up its budget
  NotApplicable,       ///< the model does not hold for what was asked (another tool)
};

struct Error {
  ErrorCode code{};
  std::string text;  ///< "what was tried: what was seen"
};

template <class T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> failure(ErrorCode code, std::string text) {
  return tl::unexpected<Error>(Error{code, std::move(text)});
}

}  // namespace abbe::calib
