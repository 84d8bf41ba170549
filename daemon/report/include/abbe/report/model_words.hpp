#pragma once
/// Texts of the reports about a model.

#include <string>
#include <vector>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The datum: "G1: positioning and angular errors are 0 at the reference position of their axis (X
/// 0 mm ..."
[[nodiscard]] std::string datum_in_words(const calib::VolumetricModel& model);
[[nodiscard]] std::vector<std::string> signs_in_words();
[[nodiscard]] std::vector<std::string> not_in_the_uncertainty(const ModelDocument& document);
/// The errors that the model does not determine, each with the reason.
[[nodiscard]] std::vector<std::string> not_estimable(const ModelDocument& document);
/// The tool offsets: "20.0, -15.0, -120.0 mm; ..."
[[nodiscard]] std::string tools_in_words(const calib::VolumetricModel& model);
/// The method: "on-the-fly with a laser tracker (otf), estimator simultaneous"
[[nodiscard]] std::string method_in_words(const ModelDocument& document);

}  // namespace abbe::daemon
