#pragma once
/// Whether values of a model are within stated limits, with the guard band of ISO 14253-1: the
/// expanded uncertainty U narrows the range in which conformity is proven, and that in
/// which non-conformity is.

#include <string>
#include <vector>

#include "abbe/report/certificate_details.hpp"
#include "abbe/report/certified_values.hpp"

namespace abbe::daemon {

/// Pass: |value| + U <= limit. Fail: |value| - U > limit. Neither: U contains the limit, or the
/// value is not estimable.
enum class Conformity { Pass, Fail, Neither };
/// "pass", "fail", "neither"
[[nodiscard]] std::string_view name(Conformity conformity) noexcept;

/// `value` and `limit` in one unit, U >= 0, limit > 0; any of them may be infinite. A value that is
/// not a number is Neither.
[[nodiscard]] Conformity conformity_of(double value, double U, double limit) noexcept;

struct JudgedValue {
  CertifiedValue value;
  std::string limit;  ///< "12.5 um", "20 urad"
  Conformity conformity = Conformity::Neither;
};

/// In the order of the limits. What is left after compensation is not known, but |V| is below U(V):
/// "U.max" and "U.rigid-free.max" are judged as the value 0 with that U, and never fail.
/// BadInput: a key that the model does not have, an angle with a limit of a length or the reverse,
/// a value without uncertainty; all of them.
[[nodiscard]] Result<std::vector<JudgedValue>> judge(const CertifiedValues& values,
                                                     const std::vector<ToleranceDetails>& limits);

/// Fail if one fails, else Neither if one is neither, else Pass. `judged` is not empty.
[[nodiscard]] Conformity conformity_of_all(const std::vector<JudgedValue>& judged) noexcept;

}  // namespace abbe::daemon
