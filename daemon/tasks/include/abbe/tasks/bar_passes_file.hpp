#pragma once
/// The touches that `abbe calibrate bar` makes, pass by pass, in the format of barpoints.csv of
/// `abbe identify bar`.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::daemon {

/// Lines of the file for the touches of one measurement.
[[nodiscard]] std::string rows_of(const calib::mfb::Measurement&, const calib::mfb::PassTouches&);
/// The text of a file with these lines.
[[nodiscard]] std::string points_csv(std::string_view rows);

/// A file that contains only whole passes.
class BarPassesFile {
 public:
  /// An existing file is used if `continues` is true, else it is refused (Usage). BadInput: a pass
  /// in the file has more or fewer touches than the pattern of the bar. The values are checked when
  /// all passes are complete.
  [[nodiscard]] static Result<BarPassesFile> open(std::filesystem::path file,
                                                  const calib::mfb::Bar& bar, bool continues);

  [[nodiscard]] bool has(std::string_view measurement) const {
    return rows_.find(measurement) != rows_.end();
  }
  /// Adds the lines of a pass and writes the file.
  [[nodiscard]] Result<void> add(const std::string& rows);
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  explicit BarPassesFile(std::filesystem::path file);
  [[nodiscard]] Result<void> count_rows(const calib::mfb::Bar& bar);

  std::filesystem::path file_;
  std::string text_;
  /// number of rows per measurement when the file was opened
  std::map<std::string, std::size_t, std::less<>> rows_;
};

}  // namespace abbe::daemon
