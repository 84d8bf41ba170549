#pragma once
/// Conditions of a measurement, the same in report and certificate: as stated in the details, else
/// as the run recorded them.

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
  std::string name;               ///< "temperature"
  std::string unit, dsi_unit;     ///< "C", "\degreecelsius"
  std::string origin{};           ///< of recorded numbers: "median over the legs"
  std::vector<Number> numbers{};  ///< one, or the lowest and the highest; empty: not recorded
};

/// Temperature, feed and measuring time always, also without numbers; others where they are known.
/// `details`: those of the measurement; without content for a measurement as left.
[[nodiscard]] std::vector<StatedCondition> stated_conditions(const ModelDocument& document,
                                                             const CertificateDetails& details);

/// "20.10 to 20.40 C, lowest and highest value of all sensors", "not recorded"
[[nodiscard]] std::string in_words(const StatedCondition& condition);

}  // namespace abbe::daemon
