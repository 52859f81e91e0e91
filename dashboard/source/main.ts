// Every page loads this module. It keeps times local and buttons alive, and starts what the page asks for.
import { localTimes, startButtons } from "./buttons";
import { startIslands } from "./islands";
import { startLive } from "./live";
import { watchClaim } from "./claim";
import { localAngles, startUnits } from "./common/units";

localTimes(document);
localAngles(document);
startButtons();
startLive();
startUnits();
startIslands(document);
watchClaim();
