// Any bytes as compensation files of a control: a correction or an error; a correction is a number
// at every place. The first byte selects the format; bytes 0x00 separate the files of a folder.
// libFuzzer: -max_len=8192

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "abbe/exports/control_reading.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace abbe::daemon;  // NOLINT(google-build-using-namespace): a program, not a header
  constexpr std::array kFormats{ExportFormat::IsgCsv,       ExportFormat::Etalon,
                                ExportFormat::LinuxcncComp, ExportFormat::SiemensCec,
                                ExportFormat::SiemensLec,   ExportFormat::HeidenhainCom,
                                ExportFormat::CsvGrid};
  if (size == 0) return 0;
  const auto format = kFormats[data[0] % kFormats.size()];
  const bool folder = facts_of(format).folder;

  std::vector<ExportFile> files{{"config.cma", ""}};
  constexpr std::array kNames{"X.COM", "Y.COM", "Z.COM"};
  for (std::size_t i = 1; i < size; ++i) {
    const char c = static_cast<char>(data[i]);
    if (folder && c == '\0' && files.size() <= kNames.size()) {
      files.push_back({kNames[files.size() - 1], ""});
    } else {
      files.back().text += c;
    }
  }

  ControlSettings settings;
  for (std::size_t a = 0; a < 3; ++a) settings.axis_names[a] = facts_of(format).axis_names[a];
  const auto control = read_as_control(format, files, settings);
  if (!control) return 0;
  for (const double place_m : {-1e3, -0.1, 0.0, 0.05, 1e3}) {
    for (const double c_m : (*control)({place_m, 0.1, -place_m}, {1, -1, 0})) {
      if (!std::isfinite(c_m)) std::abort();
    }
  }
  return 0;
}
