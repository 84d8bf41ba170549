#pragma once
/// Builds an HTML page that explains a result: text, tables and charts. The page is one file and
/// needs no network, because it contains Chart.js. One thread.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

/// Points connected by lines. `u`, if not empty, is the standard uncertainty of y and is drawn as a
/// band from y - 2 u to y + 2 u.
struct Curve {
  std::string name;
  std::vector<double> x, y, u;
};

struct LineChart {
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
};

/// Counts of values in `bins` equal intervals from the smallest to the largest value of all series.
struct Histogram {
  struct Series {
    std::string name;
    std::vector<double> values;
  };
  std::string title, x_label;
  std::vector<Series> series;
  std::size_t bins = 40;
};

/// Vectors in a plane: each is a line that begins at a dot and has `magnification` times the length
/// of the vector.
struct VectorChart {
  struct Arrow {
    double x = 0.0, y = 0.0;    ///< origin, in the units of the axes
    double dx = 0.0, dy = 0.0;  ///< vector, in the same units
  };
  std::string title, x_label, y_label, name;
  std::vector<Arrow> arrows;
  double magnification = 1.0;
};

class HtmlReport {
 public:
  explicit HtmlReport(std::string_view title);

  void heading(std::string_view);
  void paragraph(std::string_view);
  /// A table of two columns: name, value.
  void facts(const std::vector<std::pair<std::string, std::string>>&);
  void table(const std::vector<std::string>& columns,
             const std::vector<std::vector<std::string>>& rows);
  void chart(const LineChart&);
  void chart(const Histogram&);
  void chart(const VectorChart&);

  /// The complete page.
  [[nodiscard]] std::string text() const;

 private:
  void canvas(std::string_view configuration);

  std::string title_, body_;
  std::size_t charts_ = 0;
};

}  // namespace abbe::daemon
