// The appliance's words in Spanish, as data: the page and the server's reports read them. Whole
// phrases first, then patterns, whose groups ($1, $2, ...) are translated by themselves; numbers
// get the decimal comma.
import { kFaultPatterns, kFaultWords } from './es_faults.js';

export const kWords = {
  ...kFaultWords,
  up: 'arriba', down: 'abajo', 'toward gantry': 'hacia el gantry',
  'away from gantry': 'alejándose del gantry', 'to patient left': 'hacia la izquierda del paciente',
  'to patient right': 'hacia la derecha del paciente', 'head up': 'cabeza arriba',
  'head down': 'cabeza abajo', 'patient left side down': 'lado izquierdo del paciente abajo',
  'patient right side down': 'lado derecho del paciente abajo',
  'head to patient left': 'cabeza hacia la izquierda del paciente',
  'head to patient right': 'cabeza hacia la derecha del paciente',
  'to the right, facing the gantry': 'a la derecha, mirando al gantry',
  'to the left, facing the gantry': 'a la izquierda, mirando al gantry',
  'gantry end up': 'extremo del gantry arriba', 'gantry end down': 'extremo del gantry abajo',
  'right side down, facing the gantry': 'lado derecho abajo, mirando al gantry',
  'left side down, facing the gantry': 'lado izquierdo abajo, mirando al gantry',
  'counter-clockwise from above': 'en sentido antihorario visto desde arriba',
  'clockwise from above': 'en sentido horario visto desde arriba',
  'up (anterior)': 'arriba (anterior)', 'up (posterior)': 'arriba (posterior)',
  'down (anterior)': 'abajo (anterior)', 'down (posterior)': 'abajo (posterior)',
  'toward the head': 'hacia la cabeza', 'toward the feet': 'hacia los pies',
  'toward the head and patient left': 'hacia la cabeza y la izquierda del paciente',
  'toward the head and patient right': 'hacia la cabeza y la derecha del paciente',
  'toward the feet and patient left': 'hacia los pies y la izquierda del paciente',
  'toward the feet and patient right': 'hacia los pies y la derecha del paciente',
  'head and patient left side up': 'cabeza y lado izquierdo del paciente arriba',
  'head and patient right side up': 'cabeza y lado derecho del paciente arriba',
  'feet and patient left side up': 'pies y lado izquierdo del paciente arriba',
  'feet and patient right side up': 'pies y lado derecho del paciente arriba',
  'this scan is the source of a reference: it is deleted only with its patient':
    'una referencia procede de este escaneo: solo se borra con su paciente',
  'the session of a patient is open: close it first':
    'hay una sesión de un paciente abierta: ciérrela primero',
  'a scan is running: wait for its result': 'hay un escaneo en curso: espere su resultado',
  'the board has not been scanned yet': 'la lámina aún no se ha escaneado',
  ['fewer than 3 of the room\'s markers lie in the same place in all scans: sweep over the room\'s '
    + 'markers too, and do not move them']:
    'menos de 3 marcadores de la sala están igual en todos los escaneos: barra también los '
    + 'marcadores de la sala y no los toque',
  ['none of the room\'s markers was seen well: sweep over them too, the room is described by '
    + 'them']:
    'no se vio bien ningún marcador de la sala: bárralos también, la sala se describe con ellos',
  'the reference marker was not seen: keep it in view during a part of the sweep':
    'no se vio el marcador de referencia: manténgalo a la vista durante parte del barrido',
  'the board has been scanned again since this was read: read it again':
    'la lámina se ha escaneado de nuevo desde que se leyó esto: léalo otra vez',
  'the room has other markers than when it was calibrated':
    'la sala tiene otros marcadores que cuando se calibró',
  ['The signed room calibration is in effect; T_iec_reference of the configuration is ignored']:
    'Vale la calibración firmada de la sala: T_iec_reference de la configuración no se usa',
  ['fewer than 3 of the room\'s markers lie in the reference as they lay when the room was '
    + 'calibrated']:
    'menos de 3 marcadores de la sala están en la referencia como estaban cuando se calibró',
  '+X side': 'lado +X', '-X side': 'lado −X',
  'left side': 'lado izquierdo', 'right side': 'lado derecho', middle: 'centro',
  'a scan is running: wait for its result, then open the patient':
    'hay un escaneo en curso: espere su resultado y abra después el paciente',
  'this patient has no approved reference: scan and approve one first':
    'este paciente no tiene referencia aprobada: escanee y apruebe una primero',
  'name or password is wrong': 'nombre o contraseña incorrectos',
  'the password is wrong': 'la contraseña es incorrecta',
  'no session is open': 'no hay ninguna sesión abierta',
  'the session of this patient is open: close it first':
    'la sesión de este paciente está abierta: ciérrela primero',
  'this patient is archived: take it out of the archive first':
    'este paciente está archivado: sáquelo antes del archivo',
  ['the daily check is overdue, and references need one that has passed today: open Daily check, '
    + 'sweep over all markers of the room, then go on here']:
    'el control diario está pendiente y las referencias necesitan uno superado hoy: abra Control '
    + 'diario, barra todos los marcadores de la sala y siga después aquí',
  ['the daily check has failed, and references need one that has passed since: open Daily check, '
    + 'find out why it failed, sweep over all markers of the room, then go on here']:
    'el control diario no se ha superado y las referencias necesitan uno superado después: abra '
    + 'Control diario, aclare por qué no se superó, barra todos los marcadores de la sala y siga '
    + 'después aquí',
  ['the first daily check after this scan failed, so the markers may already have been out of '
    + 'place during it: scan the reference again']:
    'el primer control diario después de este escaneo no se superó, por lo que los marcadores ya '
    + 'podían estar fuera de su sitio durante el escaneo: escanee otra vez la referencia',
  ['this scan was taken after a failed daily check, and no check of the same day and sensor has '
    + 'confirmed it: scan the reference again']:
    'este escaneo se hizo después de un control diario no superado y ningún control del mismo día '
    + 'y sensor lo ha confirmado: escanee otra vez la referencia',
  ['this scan was taken while the daily check was overdue, and no check of the same day and sensor '
    + 'has confirmed it: scan the reference again']:
    'este escaneo se hizo con el control diario pendiente y ningún control del mismo día y sensor '
    + 'lo ha confirmado: escanee otra vez la referencia',
  'there is no template of this site': 'no hay ninguna plantilla de esta localización',
  'there are templates of 100 sites already: remove one first':
    'ya hay plantillas de 100 localizaciones: borre antes una',
  'there is no such scan': 'no existe ese escaneo',
  'there is no such patient': 'no existe ese paciente',
  'a scan is running already: end or cancel it first':
    'ya hay un escaneo en curso: termínelo o descártelo primero',
  'your role is not allowed to do this': 'su función no permite hacer esto',
  'no sensor is attached': 'no hay ningún sensor conectado',
  'profiles are switched off in the configuration':
    'los perfiles están desactivados en la configuración',
  'it has no serial by which it would be known again':
    'el sensor no tiene un número de serie por el que se le reconozca',
  'this scan is accepted already': 'este escaneo ya está aceptado',
  'this result is older than 2 minutes: scan again, then accept':
    'este resultado tiene más de 2 minutos: escanee de nuevo y acepte después',
  'the session of this patient is not open: a result is accepted in it':
    'la sesión de este paciente no está abierta: los resultados se aceptan en ella',
  'patient left': 'izquierda del paciente', 'patient right': 'derecha del paciente',
  head: 'cabeza', feet: 'pies', high: 'demasiado alto', low: 'demasiado bajo',
  'head and neck': 'cabeza y cuello',
  'left shoulder': 'hombro izquierdo', 'right shoulder': 'hombro derecho',
  'left chest': 'lado izquierdo del tórax', 'right chest': 'lado derecho del tórax',
  'left side of the abdomen': 'lado izquierdo del abdomen',
  'right side of the abdomen': 'lado derecho del abdomen',
  'left side of the pelvis': 'lado izquierdo de la pelvis',
  'right side of the pelvis': 'lado derecho de la pelvis',
  'to the left': 'hacia la izquierda', 'to the right': 'hacia la derecha',
  'towards the head': 'hacia la cabeza', 'towards the feet': 'hacia los pies',
  'left thigh': 'muslo izquierdo', 'right thigh': 'muslo derecho',
  'left lower leg': 'pierna izquierda', 'right lower leg': 'pierna derecha',
  'at the head end': 'en el extremo de la cabeza', 'at the feet end': 'en el extremo de los pies',
  'in the middle': 'en el centro', 'at the gantry end': 'en el extremo del gantry',
  'at the end away from the gantry': 'en el extremo opuesto al gantry',
  'at the +Y end': 'en el extremo +Y', 'at the -Y end': 'en el extremo −Y',
  vertical: 'vertical', longitudinal: 'longitudinal', lateral: 'lateral', pitch: 'cabeceo',
  roll: 'balanceo', yaw: 'guiñada', deg: '°', current: 'actual', reference: 'referencia',
  // Why there is no answer.
  ['no flat support was found in the reference scan, so the body cannot be separated from what it '
    + 'lies on; draw a region on the body, or scan the reference again with more of the couch in '
    + 'view']:
    'no se halló un apoyo plano en el escaneo de referencia y el cuerpo no se distingue de él; '
    + 'dibuje una región sobre el cuerpo o repita la referencia mostrando más camilla',
  'how much of the region the current scan covers could not be measured':
    'no se pudo medir qué parte de la región cubre el escaneo actual',
  'the holes of the current scan could not be measured':
    'no se pudieron medir los huecos del escaneo actual',
  'how well the surfaces fit could not be measured':
    'no se pudo medir cómo encajan las superficies',
  'the shared markers determine no alignment':
    'los marcadores comunes no determinan ninguna alineación',
  ['the reference scan did not see its reference marker well enough, so it has no height map; scan '
    + 'the reference again with that marker in view']:
    'el escaneo de referencia no vio bastante bien su marcador de referencia y no tiene mapa de '
    + 'alturas; repita la referencia con ese marcador a la vista',
  ['the reference scan measured no surface around its reference marker, so it has no height map; '
    + 'lay the marker flat beside the body and scan the reference again']:
    'el escaneo de referencia no midió superficie alrededor de su marcador y no tiene mapa de '
    + 'alturas; ponga el marcador plano junto al cuerpo y repita la referencia',
  'the reference scan shows no body over its support; check the reference scan':
    'el escaneo de referencia no muestra un cuerpo sobre su apoyo; revise el escaneo de referencia',
  'the reference scan measured nothing inside the region; draw the region on the body':
    'el escaneo de referencia no midió nada dentro de la región; dibuje la región sobre el cuerpo',
  'the current scan does not look like this reference: no motion of the body explains it':
    'el escaneo actual no se parece a esta referencia: ningún movimiento del cuerpo lo explica',
  'there is no installer (RAUC) on this machine; update its packages instead':
    'no hay instalador (RAUC) en esta máquina; actualice sus paquetes',
  // Warnings of a scan.
  'the markers are fixed to the couch: posture only, shifts are refused':
    'los marcadores están fijos a la camilla: solo postura, sin desplazamientos',
  'no flat support was found in the reference scan: all of it counts as body':
    'no se halló un apoyo plano en el escaneo de referencia: todo cuenta como cuerpo',
  'no flat support was found in the current scan: all of it counts as body':
    'no se halló un apoyo plano en el escaneo actual: todo cuenta como cuerpo',
  'the dense registration did not make the views agree better and was left out':
    'el registro denso no mejoró el acuerdo entre las vistas y no se usó',
  ['no marker was seen: the scene lies in the first keyframe\'s frame and cannot be compared']:
    'no se vio ningún marcador: la escena está en el sistema de la primera imagen clave y no se '
    + 'puede comparar',
  // The daily check.
  ['there is no baseline yet: if the markers are known to be in place, set this check as '
    + 'the baseline']:
    'aún no hay base: quien sepa que los marcadores están bien fija este control como base',
  'no marker was seen, so none could be measured':
    'no se vio ningún marcador y no se pudo medir ninguno',
};
export const kPatterns = [
  ...kFaultPatterns,
  ['^(.+) (\\d+) mm (?:too )?(high|low)$', '$1: $2 mm $3'],
  ['^(.+) up to (\\d+) mm (to the left|to the right|towards the head|towards the feet)$',
    '$1: hasta $2 mm $3'],
  ['^(left side|right side|[+-]X side) (at the .+|in the middle)$', '$1 $2'],
  ['^along ([+-][XY]) of the reference marker$', 'según $1 del marcador de referencia'],
  ['^([+-][XY]) side of the reference marker (up|down)$',
    'lado $1 del marcador de referencia $2'],
  ['^marker (\\d+) moved ([\\d.]+) mm$', 'el marcador $1 se movió $2 mm'],
  ['^marker (\\d+) moved ([\\d.]+) mm since the reference; ignored$',
    'el marcador $1 se movió $2 mm desde la referencia; no se usa'],
  ['^marker (\\d+)$', 'marcador $1'],
  ['^missing: (.+)$', 'faltan: $1'],
  ['^the sensor (\\S+) is not connected: look at this page again$',
    'el sensor $1 no está conectado: vuelva a abrir esta página'],
  ['^the session of (\\S+) is open \\(opened by (.+)\\): close it first$',
    'la sesión de $1 está abierta (la abrió $2): ciérrela primero'],
  // Why there is no answer.
  ['^cannot compare the scenes: the reference was made with marker dictionary (\\S+), the current '
    + 'one with (\\S+); scan both with the same markers$',
  'no se pueden comparar los escaneos: la referencia se hizo con el diccionario de marcadores $1 y '
    + 'el actual con $2; escanee ambos con los mismos marcadores'],
  ['^cannot compare the scenes: the reference was made with markers of ([\\d.]+) m, the current '
    + 'one with ([\\d.]+) m; scan both with the same markers$',
  'no se pueden comparar los escaneos: la referencia se hizo con marcadores de $1 m y el actual '
    + 'con marcadores de $2 m; escanee ambos con los mismos marcadores'],
  ['^the current scan covers ([\\d.]+) % of the region, at least ([\\d.]+) % are needed; sweep '
    + 'all of it$',
  'el escaneo actual cubre el $1 % de la región y se necesita al menos el $2 %; bárrala toda'],
  ['^the current scan has a hole of ([\\d.]+) mm in the region; at most ([\\d.]+) mm are allowed; '
    + 'sweep over it$',
  'el escaneo actual tiene un hueco de $1 mm en la región; se admiten $2 mm como máximo; barra '
    + 'sobre él'],
  ['^the current scan has a hole of ([\\d.]+) mm in the region \\(([^)]+)\\); at most ([\\d.]+) mm '
    + 'are allowed; sweep over it$',
  'el escaneo actual tiene un hueco de $1 mm en la región ($2); se admiten $3 mm como máximo; '
    + 'barra sobre él'],
  ['^the body does not look like this reference: 5 % of the region lie more than ([\\d.]+) mm away '
    + 'after the best motion$',
  'el cuerpo no se parece a esta referencia: el 5 % de la región queda a más de $1 mm tras el '
    + 'mejor ajuste'],
  ['^it is not known how long tracking was lost in the (reference|current) scan$',
    'no se sabe cuánto tiempo se perdió el seguimiento en el escaneo ($1)'],
  ['^tracking was lost for ([\\d.]+) s in the (reference|current) scan, or no image came; sweep '
    + 'again, more slowly$',
  'el seguimiento se perdió durante $1 s en el escaneo ($2), o no llegó ninguna imagen; barra de '
    + 'nuevo, más despacio'],
  ['^chest and belly rose by ([\\d.]+) mm in the (reference|current) scan, at most ([\\d.]+) mm '
    + 'are allowed; sweep again while the breath is held$',
  'el pecho y el vientre subieron $1 mm en el escaneo ($2); se admiten $3 mm como máximo; barra de '
    + 'nuevo mientras se contiene la respiración'],
  ['^(\\w+) was not measured$', '$1: no se midió'],
  // Why a result is in tolerance, unsure or a move: its numbers, one after the other.
  ['^every value and its uncertainty lie within ([\\d.]+) mm and ([\\d.]+) deg$',
    'todos los valores y su incertidumbre quedan dentro de $1 mm y $2°'],
  ['^outside ([\\d.]+) mm and ([\\d.]+) deg: (.+)$', 'fuera de $1 mm y $2°: $3'],
  ['^not surely within ([\\d.]+) mm and ([\\d.]+) deg: (.+)$',
    'no con seguridad dentro de $1 mm y $2°: $3'],
  ['^(\\w+ [+-][\\d.]+ [^,]+(?:, facing the gantry\\))?), (\\w+ [+-][\\d.]+ .+)$', '$1, $2'],
  ['^(vertical|longitudinal|lateral|pitch|roll|yaw) ([+-][\\d.]+) (mm|deg) \\((.*)\\)$',
    '$1 $2 $3 ($4)'],
  ['^(vertical|longitudinal|lateral|pitch|roll|yaw) ([+-][\\d.]+) ±([\\d.]+) (mm|deg)$',
    '$1 $2 ±$3 $4'],
  ['^(\\w+) is not well determined: ±([\\d.e+-]+) (\\w+) at 95 %, the tolerance is '
    + '([\\d.]+) (\\w+)$',
    '$1: no está bien determinado, ±$2 $3 al 95 %; la tolerancia es $4 $5'],
  ['^scan needs at least (\\d+) markers shared with the reference, found (\\d+)(?: \\(ids? '
    + '([\\d, ]+)\\))?; keep the markers in view$',
  'el escaneo necesita al menos $1 marcadores comunes con la referencia y tiene $2; mantenga los '
    + 'marcadores a la vista'],
  ['^scan needs at least (\\d+) markers that did not move since the reference, (\\d+) of (\\d+) '
    + 'shared ones agree; check where the markers lie$',
  'el escaneo necesita al menos $1 marcadores que no se hayan movido desde la referencia; '
    + 'concuerdan $2 de los $3 comunes; revise dónde están los marcadores'],
  ['^the markers fall into two groups of (\\d+) that moved against each other; check where the '
    + 'markers lie$',
  'los marcadores forman dos grupos de $1 que se movieron uno respecto a otro; revise dónde están'],
  ['^markers? ([\\d, ]+) moved since the reference, and this preset aligns the scans by '
    + '(?:it|them) nevertheless; use preset best$',
  'los marcadores $1 se movieron desde la referencia y este preajuste los usa igualmente; use el '
    + 'preajuste best'],
  // Warnings of a scan.
  ['^(\\d+) of (\\d+) frames were not tracked, ([\\d.]+) s at longest$',
    '$1 de $2 imágenes sin seguimiento, $3 s como máximo'],
  ['^the computer was too slow: (\\d+) of (\\d+) frames were left out evenly; sweep more slowly, '
    + 'and close other programs on it$',
  'el equipo fue demasiado lento: se omitieron $1 de $2 imágenes de forma regular; barra más '
    + 'despacio y cierre lo demás que se ejecute en él'],
  ['^(\\d+) of (\\d+) frames were dropped, because the processor was busy: fewer views support the '
    + 'surface$',
  'se perdieron $1 de $2 imágenes porque el procesador estaba ocupado: menos vistas sustentan la '
    + 'superficie'],
  ['^(\\d+) of (\\d+) frames were tracked with fewer keypoints, because the processor was busy: '
    + 'the camera\'s path may be less accurate$',
  '$1 de $2 imágenes se siguieron con menos puntos porque el procesador estaba ocupado: la '
    + 'trayectoria de la cámara puede ser menos exacta'],
  ['^the sweep never returned to a place: only neighbouring images hold its path together; keep a '
    + 'marker in view for longer, or end the sweep where it began$',
  'el barrido no volvió a ningún lugar: solo las imágenes vecinas sostienen su trayectoria; '
    + 'mantenga más tiempo un marcador a la vista o termine donde empezó'],
  ['^only 3 markers place the scans against each other: if one of them had moved by some '
    + 'millimetres, the other two could not show it$',
  'solo 3 marcadores relacionan los escaneos: si uno se hubiera movido unos milímetros, los otros '
    + 'dos no podrían mostrarlo'],
  ['^a part of the surface, such as chest and belly, rose and fell by ([\\d.]+) mm during the '
    + 'sweep, every ([\\d.]+) s: sweep while the breath is held$',
  'una parte de la superficie, como el pecho y el vientre, subió y bajó $1 mm durante el barrido, '
    + 'cada $2 s: barra mientras se contiene la respiración'],
  ['^no image came for ([\\d.]+) s in the sweep; what the sensor passed meanwhile is missing$',
    'no llegó ninguna imagen durante $1 s del barrido; falta lo que el sensor recorrió entretanto'],
  ['^reference marker (\\d+) was seen from (\\d+) places? only: the scene\'s frame is less certain '
    + 'than that of a sweep$',
  'el marcador de referencia $1 se vio solo desde $2 lugares: el sistema de la escena es menos '
    + 'seguro que el de un barrido'],
  // Storage and update.
  ['^The disk is (\\d+) % full: back up and remove scans.$',
    'El disco está lleno al $1 %: haga una copia de seguridad y borre escaneos.'],
  ['^The last backup failed: (.+)$', 'La última copia de seguridad falló: $1'],
  // The room's calibration.
  ['^(\\d+) of (\\d+) scans of the board have been made: scan again, without touching it$',
    'hay $1 de $2 escaneos de la lámina: escanee otra vez, sin tocarla'],
  ['^no scan of the board can be used: (.+)$', 'ningún escaneo de la lámina sirve: $1'],
  ['^the scans differ by ([\\d.]+) mm and ([\\d.]+) deg, at most ([\\d.]+) mm and ([\\d.]+) deg '
    + 'are allowed: let the sensor warm up, do not touch the board, and scan again$',
  'los escaneos difieren en $1 mm y $2°; se permiten $3 mm y $4° como máximo: deje calentar el '
    + 'sensor, no toque la lámina y escanee otra vez'],
  ['^(\\d+) of the board\'s (\\d+) markers were seen well, at least (\\d+) are needed: check '
    + 'that they are clean and uncovered, and sweep slowly over the board$',
  'se vieron bien $1 de los $2 marcadores de la lámina y se necesitan al menos $3: mire si están '
    + 'limpios y descubiertos, y barra la lámina despacio'],
  ['^the board measures ([\\d.]+) % of its size, ([\\d.]+) % off are allowed: print it at 100 %, '
    + 'without fitting to the page, and check its ruler$',
  'la lámina mide el $1 % de su tamaño; se admite un $2 % de diferencia: imprímala al 100 %, '
    + 'sin ajustar a la página, y compruebe su regla'],
  ['^the board\'s markers lie ([\\d.]+) mm \\(RMS\\) off their places on the sheet, at most '
    + '([\\d.]+) mm are allowed: lay the sheet flat on a rigid plate and sweep slowly over it$',
  'los marcadores de la lámina están a $1 mm (RMS) de su sitio; se admiten $2 mm como máximo: '
    + 'coloque la lámina plana sobre una placa rígida y bárrala despacio'],
  ['^marker (\\d+) moved ([\\d.]+) mm since the room was calibrated$',
    'el marcador $1 se movió $2 mm desde que se calibró la sala'],
  ['^the markers lie ([\\d.]+) mm \\(RMS\\) from where they were when the room was calibrated$',
    'los marcadores están a $1 mm (RMS) de donde estaban cuando se calibró la sala'],
  ['^The room must be calibrated again; until then, directions refer to the patient: (.+)$',
    'Hay que calibrar la sala de nuevo; hasta entonces las direcciones son las del paciente: $1'],
  ['^the calibration of the room, version (\\d+), is not used: (.+)$',
    'la calibración de la sala, versión $1, no se usa: $2'],
  ['^the sensor\'s depth and the stated size of the markers disagree by ([\\d.]+) %: measure the '
    + 'side of a marker$',
  'la profundidad del sensor y el tamaño indicado de los marcadores difieren un $1 %: mida el lado '
    + 'de un marcador'],
  // A cold sensor.
  ['^the sensor is still warming up, and references need one that has been on for ([\\d.]+) min: '
    + 'wait, then scan$',
  'el sensor aún se está calentando y las referencias necesitan uno encendido desde hace $1 min: '
    + 'espere y escanee después'],
  ['^the sensor was still warming up at this scan, and references need one that has been on for '
    + '([\\d.]+) min: scan the reference again$',
  'el sensor aún se estaba calentando en este escaneo y las referencias necesitan uno encendido '
    + 'desde hace $1 min: escanee otra vez la referencia'],
  // The daily check.
  ['^(\\d+) markers were seen, at least (\\d+) are needed; sweep over all of them$',
    'se vieron $1 marcadores y se necesitan al menos $2; bárralos todos'],
  ['^markers ([\\d, ]+) were not seen well: check that they are there, clean and uncovered, and '
    + 'sweep over all$',
  'los marcadores $1 no se vieron bien: mire si están, limpios y descubiertos, y bárralos todos'],
  ['^the markers lie ([\\d.]+) mm \\(RMS\\) from where they were, at most ([\\d.]+) mm are '
    + 'allowed$',
  'los marcadores están a $1 mm (RMS) de donde estaban; se admiten $2 mm como máximo'],
  ['^the markers lie (-?[\\d.]+) % farther apart than they did: the sensor\'s calibration may have '
    + 'changed$',
  'los marcadores están un $1 % más separados que antes: puede haber cambiado la calibración del '
    + 'sensor'],
  ['^marker (\\d+) is ([+-][\\d.]+) % off its stated length: check the size of its print$',
    'el marcador $1 se desvía un $2 % de su longitud: compruebe el tamaño de la impresión'],
  ['^the sensor\'s depth is off by ([+-][\\d.]+) %: let it warm up, check again, then have it '
    + 'calibrated$',
  'la profundidad del sensor se desvía un $1 %: déjelo calentar, repita el control y hágalo '
    + 'calibrar'],
];
