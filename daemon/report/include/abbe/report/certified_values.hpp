#pragma once
/// The values that report and certificate state, as text. Both print the same texts, so that their
/// numbers are equal.

#include <string>
#include <vector>

#include "abbe/calib/iso/standard_values.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Lengths in um, angles in urad. U: expanded uncertainty, k = 2, with two significant digits; the
/// value has the same number of decimals ([GUM] 7.2.6).
struct CertifiedValue {
  std::string key;                    ///< unique and stable, for programs: "X.M", "EYX", "PPP.E"
  std::string name;                   ///< name for people
  std::string value;                  ///< decimal number; empty: not estimable
  std::string U{};                    ///< empty: no uncertainty is stated
  bool is_angle = false;              ///< true: urad; false: um
  std::string why{};                  ///< reason why the value is not estimable
  double value_si = 0.0, u_si = 0.0;  ///< m or rad, not rounded; u: k = 1
};

struct ValueGroup {
  std::string name, explanation;
  std::vector<CertifiedValue> values;
};

struct CertifiedValues {
  calib::iso::StandardValues standard;
  calib::iso::VolumeError volume;
  /// first the group of the volume, then the groups of the standards
  std::vector<ValueGroup> groups;
};

/// The values of a model. DataInsufficient if it has no validity volume.
[[nodiscard]] Result<CertifiedValues> certified_values(const ModelDocument& document);

}  // namespace abbe::daemon
