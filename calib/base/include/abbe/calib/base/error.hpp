#pragma once
/// Errors of `calib` are return values. The text states the attempted operation and, in numbers,
/// the observed result.

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace abbe::calib {

enum class ErrorCode {
  BadInput,            ///< an argument breaks its documented contract (shape, order, range, syntax)
  NotFinite,           ///< NaN or infinity in the input
  TooFewObservations,  ///< not enough data for the computation
  DegenerateGeometry,  ///< points are collinear, coincident or coplanar
  AlignmentFailed,     ///< the measured points do not fit the given path
  RankDeficient,       ///< some parameter is not determined by the data
  NotConverged,        ///< an iteration reached its limit
  NotApplicable,       ///< the model is not valid for this request (another tool)
};

struct Error {
  ErrorCode code{};
  std::string text;  ///< format "attempted operation: observed result"
};

template <class T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> failure(ErrorCode code, std::string text) {
  return tl::unexpected<Error>(Error{code, std::move(text)});
}

}  // namespace abbe::calib
