#pragma once
/// The conditions of a measurement, the same in report and certificate. They are those stated in
/// the details, or else those that the run recorded.

#include <string>
#include <vector>

#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

struct StatedCondition {
  struct Number {
    std::string label;  ///< unique in a certificate: "temperature, lowest"
    std::string value;  ///< decimal number
    std::string U{};    ///< expanded uncertainty (k = 2); empty: none is stated
  };
  std::string name;            ///< "temperature"
  std::string unit, dsi_unit;  ///< "C", "\degreecelsius"
  std::string origin{};        ///< origin of a recorded number: "median over the legs"
  /// one number, or the lowest and the highest; empty: not recorded
  std::vector<Number> numbers{};
};

/// Temperature, feed and measuring time are always in the result, even without numbers; other
/// conditions only if they are known. `details`: those of the measurement; empty for a measurement
/// as left.
[[nodiscard]] std::vector<StatedCondition> stated_conditions(const ModelDocument& document,
                                                             const CertificateDetails& details);

/// The condition as text: "20.10 to 20.40 C, lowest and highest value of all sensors", or "not
/// recorded".
[[nodiscard]] std::string in_words(const StatedCondition& condition);

}  // namespace abbe::daemon
