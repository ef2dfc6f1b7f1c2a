/** The operator page: defines its elements, then asks the service what there is. */
import "./elements/mission-picker.js";
import "./elements/mission-status.js";
import "./elements/mission-commands.js";
import "./elements/session-badge.js";
import "./elements/mission-form.js";
import "./elements/figure-board.js";
import "./elements/scene-frame.js";
import "./elements/line-chart.js";
import "./elements/chart-strip.js";
import "./elements/image-grid.js";
import "./elements/candidate-table.js";
import "./elements/event-list.js";
import "./elements/result-list.js";
import "./elements/detail-tabs.js";
import "./elements/error-toast.js";
import { report, store } from "./store.js";

store.begin().catch(report);
