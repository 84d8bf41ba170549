#pragma once
/// A page that explains a result: text, tables and charts in one file that needs no network, now or
/// in ten years (Chart.js is inside). Builder; one thread.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

/// Points joined by lines. `u`, where given, is the standard uncertainty of y: drawn as a band of
/// two either side.
struct Curve {
  std::string name;
  std::vector<double> x, y, u;
};

struct LineChart {
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
};

/// How often values occur, in `bins` equal steps from the smallest to the largest of all series.
struct Histogram {
  struct Series {
    std::string name;
    std::vector<double> values;
  };
  std::string title, x_label;
  std::vector<Series> series;
  std::size_t bins = 40;
};

/// Arrows in a plane: each begins at its dot and is drawn `magnification` times as long as it is.
struct VectorChart {
  struct Arrow {
    double x = 0.0, y = 0.0;    ///< where it begins, in the units of the axes
    double dx = 0.0, dy = 0.0;  ///< the same units
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
  /// Two columns: what, value.
  void facts(const std::vector<std::pair<std::string, std::string>>&);
  void table(const std::vector<std::string>& columns,
             const std::vector<std::vector<std::string>>& rows);
  void chart(const LineChart&);
  void chart(const Histogram&);
  void chart(const VectorChart&);

  /// The whole page.
  [[nodiscard]] std::string text() const;

 private:
  void canvas(std::string_view configuration);

  std::string title_, body_;
  std::size_t charts_ = 0;
};

}  // namespace abbe::daemon
