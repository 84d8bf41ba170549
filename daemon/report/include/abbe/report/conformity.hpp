#pragma once
/// Decides whether values of a model are within stated limits, with the guard band of ISO 14253-1:
/// the expanded uncertainty U narrows both the range in which conformity is proven and the range in
/// which non-conformity is proven.

#include <string>
#include <vector>

#include "abbe/report/certificate_details.hpp"
#include "abbe/report/certified_values.hpp"

namespace abbe::daemon {

/// Pass: |value| + U <= limit. Fail: |value| - U > limit. Neither: the limit is between |value| - U
/// and |value| + U, or the value is not estimable.
enum class Conformity { Pass, Fail, Neither };
/// "pass", "fail", "neither"
[[nodiscard]] std::string_view name(Conformity conformity) noexcept;

/// The conformity of one value. `value`, `U` and `limit` have the same unit; U >= 0, limit > 0; any
/// of them may be infinite. NaN gives Neither.
[[nodiscard]] Conformity conformity_of(double value, double U, double limit) noexcept;

struct JudgedValue {
  CertifiedValue value;
  std::string limit;  ///< "12.5 um", "20 urad"
  Conformity conformity = Conformity::Neither;
};

/// The conformity of each value that has a limit, in the order of the limits. The error left after
/// compensation is not known, but |V| is below U(V): "U.max" and "U.rigid-free.max" are judged as
/// the value 0 with this U, and never fail. BadInput, with all faults, for a key that the model
/// does not have, for an angle with a limit for a length or the reverse, and for a value without
/// uncertainty.
[[nodiscard]] Result<std::vector<JudgedValue>> judge(const CertifiedValues& values,
                                                     const std::vector<ToleranceDetails>& limits);

/// The conformity of all values together: Fail if one is Fail, else Neither if one is Neither, else
/// Pass. `judged` is not empty.
[[nodiscard]] Conformity conformity_of_all(const std::vector<JudgedValue>& judged) noexcept;

}  // namespace abbe::daemon
